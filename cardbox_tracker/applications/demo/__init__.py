"""The film of ``cardbox demo`` with its reference, and the demo's figures."""
