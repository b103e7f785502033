"""Model no more than a scene needs: probes on the scene that choose a setting, or say what the next would change.

Each function goes with a stage. What was chosen, what would have been next and how far that moves positions becomes a
:class:`~towval.model.Choice` in the stage's file. Under "auto" the cheapest setting is taken whose difference to the
next finer one is below a third of the measurement uncertainty: then it adds less than 6 % to that.
"""
