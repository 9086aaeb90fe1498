"""The camera: calibration, encodings, extrinsics, pairing, stereo, depth images, devices.

An image is an array (height, width) or (height, width, 3) of uint8, bgr; a depth image (height,
width) of float32, metres, 0 or nan where nothing was measured. Points (..., 3) are metres in the
optical frame (x right, y down, z forward), pixels (..., 2) column and row.
"""
