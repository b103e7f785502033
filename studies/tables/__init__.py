"""Tables that state what towval reaches, each a command: python -m studies.tables.NAME."""
