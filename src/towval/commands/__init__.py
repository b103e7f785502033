"""One module a stage: read files, call the stage, write its file. The workflow's scripts and the CLI both run these."""
