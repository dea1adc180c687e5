"""Identification: friction, rotor inertias, payloads and inertias of links from recordings."""
