"""An uncertain input from outside the package: gravity where the runs were filmed."""

from dataclasses import replace

from towval.model.inputs import SearchRange, StatedDeviation, UncertainInput, register


def with_gravity(real, value):
    """The realisation under another gravity [m/s²]."""
    ground = replace(real.scene.ground, gravity=float(value[0]))
    return replace(real, scene=replace(real.scene, ground=ground))


register(
    UncertainInput(
        "gravity",
        "local gravity",
        "m/s²",
        "campaign",
        with_gravity,
        lambda scene: scene.ground.gravity,
        stated=StatedDeviation("gravity_std_m_per_s2", "that acceleration", 10, 0.02, "9.78 to 9.83 on Earth"),
        search=SearchRange(lambda _: 0.1, lambda _: 1.0),
    )
)
