"""What checks the annotations while the tests run: beartype, with an int wherever a float is written (PEP 484)."""

from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
