"""Physics of the towed object: contact, friction, tether, quasi-static model, dynamics. Numbers in, numbers out."""
