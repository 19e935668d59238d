"""Adapters to models of other projects. Importing them requires none of those."""
