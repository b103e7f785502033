"""From tracks to a verdict: decimation, simulation, uncertainty, comparison, identification."""
