"""Drives the goals of all leaves over their action servers, until each is accounted for."""
