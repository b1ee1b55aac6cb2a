"""Tables of a page: which a narrow screen takes apart, and what it says beside their numbers then."""

from springline.runner.report import Document, Table, to_html

LONG = "a sentence that is longer than any word, so that it needs a line of its own"


def page(table: Table) -> str:
    return to_html(Document("title", "subtitle", [table])).partition("<main>")[2]


def test_a_table_that_ends_with_sentences_says_what_its_numbers_are_of() -> None:
    text = page(Table(("", "$q_1$", "what it is"), [("time", "1 s", LONG)], words=(2,)))
    assert '<table class="told">' in text
    assert '<td class="number short" data-of="q₁">1 s</td>' in text
    assert f"<td>{LONG}</td>" in text


def test_a_list_has_no_row_of_empty_headings() -> None:
    text = page(Table(("", ""), [("one", LONG)], labels=2))
    assert "<thead>" not in text and '<table class="told">' in text and "data-of" not in text


def test_a_table_of_numbers_stays_one_and_is_dense_with_many_columns() -> None:
    few = page(Table(("key", "value"), [("a", "0." + 30 * "1")]))
    many = page(Table([f"`a.b{k}`" for k in range(9)], [[str(k) for k in range(9)]]))
    assert "<table>" in few and "data-of" not in few + many
    assert '<table class="dense">' in many
    assert "<code>a.<wbr>b3</code>" in many  # a long key in a heading may be broken after its table
