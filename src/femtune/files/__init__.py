"""Files of others: decks, tests and studies, in and out."""
