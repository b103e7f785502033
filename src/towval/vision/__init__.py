"""The eyes: camera model, floor, corner detection, tracking. Arrays in, arrays out; OpenCV computes here."""
