"""The physics of a towed object: contact, friction, tether, quasi-static motion, dynamics. Numbers in, numbers out."""
