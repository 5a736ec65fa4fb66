from scanlock.cli.output import is_due


def test_a_kill_costs_few_rows_and_keeping_them_little_work():
    kept, written = 0, 0
    for count in range(1, 20_001):
        if is_due(count):
            kept = count
            written += count
        lost = count - kept
        assert lost == 0 if count <= 200 else lost <= count / 100
        assert written <= 250 * count
