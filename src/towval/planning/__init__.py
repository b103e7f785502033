"""The rover: kinematics of four steered wheels, feasible instantaneous centres, paths, planner, closed loop."""
