__version__: str  #: semantic (docs/versions.md); written by the build
