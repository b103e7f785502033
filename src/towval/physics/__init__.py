"""The physics of a towed object: contact, friction, tether, quasi-static motion and dynamics. Numbers in, numbers out."""
