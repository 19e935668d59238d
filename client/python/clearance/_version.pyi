__version__: str  #: semantic (docs/install.md); written by the build
