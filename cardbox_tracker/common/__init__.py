"""Common ground of all folders: errors, files, settings, compiling, processes, progress.

Nothing here knows a person or a camera. A user's mistake is a :class:`.CardboxError` whose text
has the fault, the expectation and the remedy; a file is written completely or not at all; a setting
is declared once, with its unit and range.
"""
