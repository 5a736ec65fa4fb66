from scanlock.optimisation.solvers.notes import LengthNote


def test_lengths_are_scaled_and_other_numbers_stay():
    note = LengthNote("D = {:.3g} m, 3 times {:.2f} m", (0.6, 0.2))
    assert str(note) == "D = 0.6 m, 3 times 0.20 m"
    assert str(note.scaled(2.5)) == "D = 1.5 m, 3 times 0.50 m"
