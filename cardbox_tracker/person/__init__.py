"""The person, without a camera: joints, sizes, kinematics, patches, model file, URDF, REP-155.

A state is a row of joint values, rad and metres, in the order of the skeleton. The *reference
frame* R used throughout: origin at the camera's centre, X towards the camera (out of the chest of a
person who faces it), Y to the right of the image (the facing person's left), Z up. It stays level
when the camera is pitched.
"""
