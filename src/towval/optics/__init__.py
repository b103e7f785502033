"""The camera model that calibration, tracking and drawing share: projection, and its uncertainty on a plane."""
