"""Select no more model than a scene needs: probes on the scene select a setting, or measure the effect of the next one.

Each module belongs to a stage. The selected setting, the next one and the difference of positions between them become a
:class:`~towval.model.Choice` in the stage's file. Under "auto" the cheapest setting is taken whose difference from the
next finer one is below a third of the measurement uncertainty: then it adds less than 6 % to that.
"""
