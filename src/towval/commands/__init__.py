"""One module per stage: read files, call the stage, write its file. Both the workflow and the command line use them.

Arguments that commands share: ``campaign``, the campaign folder; ``name`` of the run; ``camera``, the campaign's
``camera.mcap``; ``folder`` of the run's result files; ``output``, the file to write; ``keys``, the section of the
stage in the configuration. Missing or damaged files and bad settings raise :class:`~towval.model.errors.InputError`.
"""
