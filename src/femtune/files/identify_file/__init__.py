"""A file that says what is to be identified: the record or the functions, the channels, the band, the methods."""

from femtune.files.identify_file.read import read_identify_file
from femtune.files.identify_file.tables import (
    KNOWN_INPUT,
    OUTPUT_ONLY,
    ChannelEntry,
    IdentifyFile,
    IdentifyTable,
)

__all__ = ["KNOWN_INPUT", "OUTPUT_ONLY", "ChannelEntry", "IdentifyFile", "IdentifyTable", "read_identify_file"]
