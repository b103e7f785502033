"""One module per stage: read files, call the stage, write its file. Both the workflow and the command line use them.

Arguments that commands share: ``campaign``, the campaign folder; ``name`` of the run; ``camera``, the campaign's
``camera.mcap``; ``folder`` of the run's result files; ``results``, the folder with ``camera.mcap`` and a folder for
each run; ``track``, ``decimated``, ``simulated``, ``uncertainty`` and ``identified``, files of these stages;
``output``, the file to write; ``keys``, the section of the stage in the configuration. Missing or damaged files and bad
settings raise :class:`~towval.model.errors.InputError`.
"""
