"""One module per stage: read files, call the stage, write its file. Both the workflow and the command line use them."""
