"""Histograms as files for other programs."""

import csv

import numpy as np
import pytest

from sketchmatch.errors import InvalidInputError, Reason
from sketchmatch.io.histogram_files import HistogramTable, check_histogram_path, save_histograms

ROWS = np.random.default_rng(0).uniform(0, 1e3, (2, 36)) ** 3
TABLE = HistogramTable(ROWS, [(0, 2), (2, 1)], ["desk, old", "", "Büro"], "constant", 0.0)


def test_an_archive_is_read_without_pickle(tmp_path):
    save_histograms(tmp_path / "x.npz", TABLE)
    with np.load(tmp_path / "x.npz", allow_pickle=False) as found:
        assert (found["histograms"] == ROWS).all()
        assert found["pairs"].tolist() == [[0, 2], [2, 1]]
        assert found["directions_radians"] == pytest.approx(np.radians(10.0 * np.arange(36)))
        assert found["labels"].tolist() == ["desk, old", "", "Büro"]
        assert float(found["exponent"]) == 0.0
        assert str(found["histogram"]) == "constant"


def test_a_table_reads_back_exactly(tmp_path):
    save_histograms(tmp_path / "x.CSV", TABLE)
    with (tmp_path / "x.CSV").open(encoding="utf-8", newline="") as file:
        head, *lines = csv.reader(file)
    assert head[:6] == ["a", "b", "a_label", "b_label", "0", "10"]
    assert [line[:4] for line in lines] == [["0", "2", "desk, old", "Büro"], ["2", "1", "Büro", ""]]
    assert (np.array([line[4:] for line in lines], dtype=float) == ROWS).all()


@pytest.mark.parametrize("name", ["x.txt", "x", "x.npy", "missing/x.npz"])
def test_other_names_are_refused_before_any_work(tmp_path, name):
    for refuse in (check_histogram_path, lambda path: save_histograms(path, TABLE)):
        with pytest.raises(InvalidInputError) as caught:
            refuse(tmp_path / name)
        assert (caught.value.reason, caught.value.field) == (Reason.INVALID_FILE, "out")


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    for name in ("folder.npz", "folder.csv"):
        (tmp_path / name).mkdir()
        with pytest.raises(InvalidInputError, match="cannot be written"):
            save_histograms(tmp_path / name, TABLE)
