"""How a study is run: its steps in their order, the run folder, the journal of solutions."""
