from scanlock.cli.output import is_due


def test_at_most_one_percent_of_the_rows_is_unsaved_with_bounded_work():
    saved, written = 0, 0
    for count in range(1, 20_001):
        if is_due(count):
            saved = count
            written += count
        unsaved = count - saved
        assert unsaved == 0 if count <= 200 else unsaved <= count / 100
        assert written <= 250 * count
