import numpy as np
import pytest

from tidemesh.errors import InputError
from tidemesh.hierarchy.line_tree import divide_lines


def test_constant_target_gives_equal_halves():
    breaks = divide_lines([0.0], [80.0], lambda arc: np.full(len(arc), 10.0))
    np.testing.assert_allclose(breaks, np.arange(9) * 10.0)


def test_strict_pieces_are_shorter_than_their_targets():
    def size(arc):
        return 0.5 + 0.1 * np.abs(arc - 30.0)

    breaks = divide_lines([0.0], [100.0], size, rule="strict")
    piece, middle = np.diff(breaks), 0.5 * (breaks[1:] + breaks[:-1])
    assert (piece < size(middle) * 1.00001).all()


def test_graded_pieces_stay_within_a_third_of_their_targets():
    def size(arc):
        return 2.0 + 0.02 * arc

    breaks = divide_lines([0.0], [100.0], size, rule="graded")
    piece, middle = np.diff(breaks), 0.5 * (breaks[1:] + breaks[:-1])
    ratio = piece / size(middle)
    assert ratio.max() < 1.4
    assert ratio.min() > 0.6


def test_runs_are_divided_on_their_own():
    breaks = divide_lines(
        [0.0, 10.0], [10.0, 26.0], lambda arc: np.where(arc < 10.0, 5.0, 4.0)
    )
    np.testing.assert_allclose(breaks, [0, 5, 10, 14, 18, 22, 26])


def test_no_piece_is_shorter_than_the_minimum():
    breaks = divide_lines(
        [0.0], [64.0], lambda arc: np.full(len(arc), 0.1), minimum_length=3.0
    )
    assert np.diff(breaks).min() == 4.0


def test_vanishing_size_is_an_input_error():
    with pytest.raises(InputError, match="raise the smallest size"):
        divide_lines([0.0], [1.0], lambda arc: np.abs(arc - 1.0 / 3.0))
