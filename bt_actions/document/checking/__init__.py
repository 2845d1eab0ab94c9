"""The checks of a document beyond its form: names, types and hazards.

Reports to the documents' sources; changes no document, and makes no behaviour.
"""
