"""Robot descriptions of a measured person: URDF, and the joints of REP-155."""
