"""A scene's files, decoded and checked once; shapes and patterns as arrays."""
