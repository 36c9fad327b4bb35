"""Pictures of a grid: text, and RGB drawn in NumPy.

A shape is a signed distance (negative inside, in cells) from the centre of every pixel; half a pixel around zero is
blended, which makes all edges smooth. The palette is Okabe & Ito's, safe for colour-blind readers; shapes differ too.
    star  goal      black hole  pit      dark block  wall      ring  start
    disc  agent: the chevron is the action it chose, the tail comes from the cell it left (they differ after a slip)
"""

import numpy as np

from irl_gym_envs.grid_map import MOVES, GridMap

LARGEST, BIGGEST_CELL, SMALLEST_DETAILED = 768, 56, 10
"""Pixels: of the picture's longer side, of a cell at most, of a cell at least for shapes to be drawn."""
RINGS = 12
"""More start cells than this are not marked: they would hide the picture."""

WALL, FRAME, GAP, FLOOR = (71, 82, 99), (71, 82, 99), (221, 219, 211), (248, 247, 243)
GOAL_FLOOR, GOAL, PIT_FLOOR, PIT, PIT_RIM = (205, 236, 222), (0, 158, 115), (248, 222, 205), (38, 38, 44), (213, 94, 0)
START, AGENT, AGENT_RIM, WHITE = (150, 150, 150), (0, 114, 178), (0, 74, 122), (255, 255, 255)

STAR = [(np.pi * (k / 5 - 0.5), 0.34 if k % 2 == 0 else 0.15) for k in range(10)]
STAR_POINTS = np.array([(radius * np.sin(angle) + 0.02, radius * np.cos(angle)) for angle, radius in STAR])
CHEVRON = np.array([(0.13, -0.085), (0.0, 0.085), (-0.13, -0.085)])
"""(y, x) of an open angle that points right."""
NAMES = ("up", "right", "down", "left")


def draw_text(grid: GridMap, state: int | None, came_from: int | None, action: int | None) -> str:
    """The grid in characters: o agent, G goal, X pit, S start, # wall, and a line about the last move."""
    columns = grid.shape[1]
    letters = np.full(grid.shape, ".")
    if (grid.start > 0).sum() <= RINGS:
        letters[grid.start > 0] = "S"
    letters[grid.goals], letters[grid.pits], letters[grid.walls] = "G", "X", "#"
    if state is not None:
        letters.flat[state] = "o"
    lines = ["+" + "-" * (2 * columns + 1) + "+"]
    lines += ["| " + " ".join(line) + " |" for line in letters]
    lines += [lines[0], _said(grid, state, came_from, action)]
    return "\n".join(lines) + "\n"


def _said(grid: GridMap, state: int | None, came_from: int | None, action: int | None) -> str:
    """The last move in words."""
    if state is None:
        return "no episode is under way"
    columns = grid.shape[1]
    at = f"o at row {state // columns}, column {state % columns}"
    if action is None or came_from is None:
        return at
    moved = (state // columns - came_from // columns, state % columns - came_from % columns)
    went = "stayed" if moved == (0, 0) else f"went {NAMES[MOVES.index(moved)]}"
    end = ", the episode is over" if grid.terminal.flat[state] else ""
    return f"{at}: chose {NAMES[action]}, {went}{end}"


class Picture:
    """Draws a map once, and the agent on a copy of it each time.

    Args:
        grid: the map.
    """

    def __init__(self, grid: GridMap):
        self._grid = grid
        self._cell = int(np.clip(LARGEST // max(grid.shape), 1, BIGGEST_CELL))
        self._margin = self._cell // 8
        self._background = self._draw_background()

    def draw(self, state: int | None, came_from: int | None, action: int | None) -> np.ndarray:
        """(H, W, 3) uint8 picture of the map with the agent in a state."""
        canvas = self._background.copy()
        if state is not None:
            row, column = divmod(state, self._grid.shape[1])
            if self._cell < SMALLEST_DETAILED:
                self._window(canvas, row, column)[:] = AGENT
            else:
                self._draw_agent(canvas, row, column, came_from, action)
        margin = self._margin
        framed = np.empty((canvas.shape[0] + 2 * margin, canvas.shape[1] + 2 * margin, 3), dtype=np.uint8)
        framed[:] = FRAME
        framed[margin : margin + canvas.shape[0], margin : margin + canvas.shape[1]] = np.rint(canvas)
        return framed

    def _window(self, canvas: np.ndarray, row: int, column: int, down: int = 1, right: int = 1) -> np.ndarray:
        """The pixels of a block of cells, writeable."""
        c = self._cell
        return canvas[row * c : (row + down) * c, column * c : (column + right) * c]

    def _draw_background(self) -> np.ndarray:
        grid, c = self._grid, self._cell
        starts = (grid.start > 0) & ((grid.start > 0).sum() <= RINGS)
        kinds = np.select([grid.walls, grid.goals, grid.pits, starts], [1, 2, 3, 4], 0)
        tiles = np.stack([self._tile(kind) for kind in range(5)])
        return tiles[kinds].transpose(0, 2, 1, 3, 4).reshape(grid.shape[0] * c, grid.shape[1] * c, 3)

    def _tile(self, kind: int) -> np.ndarray:
        """(cell, cell, 3) one of floor, wall, goal, pit, start."""
        c = self._cell
        floor = (FLOOR, WALL, GOAL_FLOOR, PIT_FLOOR, FLOOR)[kind]
        tile = np.empty((c, c, 3))
        if c < SMALLEST_DETAILED:
            tile[:] = (FLOOR, WALL, GOAL, PIT_RIM, START)[kind]
            return tile
        tile[:] = WALL if kind == 1 else GAP
        if kind == 1:
            return tile
        y, x = pixels(c, c, c)
        self._paint(tile, box(y, x, 0.47, 0.07), floor)
        if kind == 2:
            self._paint(tile, polygon(y, x, STAR_POINTS), GOAL)
        elif kind == 3:
            self._paint(tile, circle(y, x, 0.33), PIT_RIM)
            self._paint(tile, circle(y, x, 0.29), PIT)
            self._paint(tile, circle(y + 0.04, x, 0.2), (22, 22, 26))
        elif kind == 4:
            self._paint(tile, np.abs(circle(y, x, 0.36)) - 0.015, START)
        return tile

    def _draw_agent(self, canvas: np.ndarray, row: int, column: int, came_from: int | None, action: int | None) -> None:
        if came_from is not None and came_from != row * self._grid.shape[1] + column:
            self._draw_tail(canvas, row, column, *divmod(came_from, self._grid.shape[1]))
        window = self._window(canvas, row, column)
        y, x = pixels(self._cell, self._cell, self._cell)
        self._paint(window, circle(y, x, 0.31), AGENT_RIM)
        self._paint(window, circle(y, x, 0.27), AGENT)
        if action is None:
            self._paint(window, circle(y, x, 0.07), WHITE)
            return
        down, right = MOVES[action]
        # Turn the pixels, not the chevron: (right, down) is the direction it should point to.
        along, across = x * right + y * down, y * right - x * down
        first, middle, last = CHEVRON
        arm = np.minimum(segment(across, along, first, middle), segment(across, along, middle, last))
        self._paint(window, arm - 0.038, WHITE)

    def _draw_tail(self, canvas: np.ndarray, row: int, column: int, from_row: int, from_column: int) -> None:
        top, left = min(row, from_row), min(column, from_column)
        down, right = abs(row - from_row) + 1, abs(column - from_column) + 1
        window = self._window(canvas, top, left, down, right)
        y, x = pixels(window.shape[0], window.shape[1], self._cell)
        ends = np.array([(from_row - top, from_column - left), (row - top, column - left)]) - (np.array([down, right]) - 1) / 2
        self._paint(window, segment(y, x, ends[0], ends[1]) - 0.09, AGENT, opacity=0.35)

    def _paint(self, canvas: np.ndarray, distance: np.ndarray, colour: tuple[int, int, int], opacity: float = 1.0) -> None:
        """Blend a colour into the pixels inside a shape."""
        cover = opacity * np.clip(0.5 - distance * self._cell, 0, 1)[..., None]
        canvas += cover * (np.array(colour, dtype=float) - canvas)


def pixels(height: int, width: int, cell: int) -> tuple[np.ndarray, np.ndarray]:
    """(y, x) of the pixel centres, in cells from the middle; broadcastable to (height, width)."""
    y = (np.arange(height) + 0.5 - height / 2) / cell
    x = (np.arange(width) + 0.5 - width / 2) / cell
    return y[:, None], x[None, :]


def circle(y: np.ndarray, x: np.ndarray, radius: float) -> np.ndarray:
    """Signed distance from a circle round the middle."""
    return np.hypot(y, x) - radius


def box(y: np.ndarray, x: np.ndarray, half: float, rounding: float) -> np.ndarray:
    """Signed distance from a square with rounded corners."""
    dy, dx = np.abs(y) - half + rounding, np.abs(x) - half + rounding
    return np.hypot(np.maximum(dy, 0), np.maximum(dx, 0)) + np.minimum(np.maximum(dy, dx), 0) - rounding


def segment(y: np.ndarray, x: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance from a line between two points (y, x)."""
    (sy, sx), (ey, ex) = start, end
    along = ((y - sy) * (ey - sy) + (x - sx) * (ex - sx)) / ((ey - sy) ** 2 + (ex - sx) ** 2)
    t = np.clip(along, 0, 1)
    return np.hypot(y - sy - t * (ey - sy), x - sx - t * (ex - sx))


def polygon(y: np.ndarray, x: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Signed distance from a closed polygon with corners (n, 2) in (y, x); inside is found by the even-odd rule."""
    distance, inside = np.full(np.broadcast_shapes(y.shape, x.shape), np.inf), False
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        distance = np.minimum(distance, segment(y, x, start, end))
        if start[0] == end[0]:
            continue  # a level edge is never crossed by the level ray
        crossing = start[1] + (y - start[0]) * (end[1] - start[1]) / (end[0] - start[0])
        inside = inside ^ (((y < start[0]) != (y < end[0])) & (x < crossing))
    return np.where(inside, -distance, distance)
