"""Text that others wrote, as it is printed."""

from bilayer_core.errors import InputError, UnknownName
from bilayer_core.printable import LONGEST_LINE, MORE, printable, shortened

HOSTILE = "\x1b]0;title\x07\x9b2J\u202egnp.exe\u200b\r\x00"


def test_text_has_no_character_left_that_a_terminal_obeys():
    for found in (shortened(HOSTILE + "\n"), printable(HOSTILE)):
        assert found.isprintable()
        assert "\\x1b]0;title" in found and "\\u202egnp.exe" in found


def test_long_text_is_cut_off_also_where_escapes_make_it_long():
    assert shortened("x" * 10**7, 50) == "x" * 50 + MORE
    assert len(shortened("\U000e0001" * 40, 50)) == 50 + len(MORE)
    assert shortened("Länge ε −", 50) == "Länge ε −"


def test_errors_show_hostile_text_of_files_as_escapes_and_keep_their_lines():
    for error in (InputError(f"{HOSTILE}\nsecond"), UnknownName(f"{HOSTILE}\nsecond")):
        first, second = str(error).split("\n")
        assert first.isprintable() and second == "second"
    assert len(str(InputError("x" * 10**7))) <= LONGEST_LINE + len(MORE)
