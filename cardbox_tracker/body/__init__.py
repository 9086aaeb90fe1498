"""Body model of a person: sizes, posture, kinematics, cardbox patches.

The *reference frame* R used throughout: origin at the camera's centre, X towards the camera (out of
the chest of a person who faces it), Y to the right of the image (the facing person's left), Z up.
It stays level when the camera is pitched.
"""
