"""From pictures to planar poses of rover and object, with their uncertainty."""
