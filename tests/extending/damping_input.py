"""An uncertain input from outside the package: the damping of the tether."""

from dataclasses import replace

from towval.model.inputs import SearchRange, StatedDeviation, UncertainInput, register


def with_damping(real, value):
    """The realisation with another damping of the tether [N s/m], zero or more."""
    tether = replace(real.scene.tether, damping=max(0.0, float(value[0])))
    return replace(real, scene=replace(real.scene, tether=tether))


register(
    UncertainInput(
        "damping",
        "damping of the cord",
        "N s/m",
        "campaign",
        with_damping,
        lambda scene: scene.tether.damping,
        stated=StatedDeviation("tether.damping_std_Ns_per_m", "that damping", 1000, 2.5, "nobody measures it"),
        search=SearchRange(lambda _: 1.0, lambda _: 20.0),
    )
)
