__version__: str  #: semantic (docs/start.md, Versions); written by the build
