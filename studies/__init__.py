"""Studies on top of the stages: speed against accuracy, stability, sensitivity. They own no physics."""
