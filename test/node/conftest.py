import pytest

pytest.importorskip('rclpy', reason='live tests need ROS 2: source Jazzy, or pip install ".[ros]"')

from live import Cell


@pytest.fixture
def start_cell(tmp_path):
    """Starts cells that are closed at the end of the test."""
    cells = []

    def start(*args, **kwargs):
        cells.append(Cell(tmp_path, *args, **kwargs))
        return cells[-1]

    yield start
    for cell in cells:
        cell.close()


@pytest.fixture(scope='module')
def shared_cell(tmp_path_factory):
    cell = Cell(tmp_path_factory.mktemp('cell'))
    yield cell
    cell.close()


@pytest.fixture
def cell(shared_cell):
    """An active node with default parameters and nothing behind it."""
    shared_cell.set(
        circle__mode='paper', circle__window=3, circle__radius=0.0, circle__radius_scale=1.0,
        circle__vote_region=[0] * 4, reprocess_last=True, output__mask=True, output__score=False,
    )  # fmt: skip
    shared_cell.trigger('reset')
    shared_cell.forget()
    return shared_cell
