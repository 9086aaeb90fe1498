"""Upper-body posture of one person from the silhouettes of one fixed camera.

The folders follow the data: :mod:`.body` is what a person is, :mod:`.vision` what the camera sees,
:mod:`.estimation` how a posture is found, :mod:`.ros` the nodes around it.
"""

__version__ = "0.1.0"
