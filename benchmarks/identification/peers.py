"""What users would take instead: pyOMA2, koma and sdypy-EMA, each as its own documentation calls it.

Their poles of every order come back in one table, so that all are judged by the same choice of modes.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import warnings
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from femtune.identification.pole_table import PoleTable, table_of
from femtune.modal import FrfSet, TimeSeries


def installed(name: str) -> bool:
    """True where a peer can be imported."""
    with contextlib.suppress(ModuleNotFoundError):
        return importlib.util.find_spec(name) is not None
    return False


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Progress bars and warnings of others are not for this table."""
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        yield


def pyoma2_ssi(record: TimeSeries, references: list[int], rows: int, order: int) -> PoleTable:
    """Covariance-driven SSI of pyOMA2, orders in steps of two."""
    from pyoma2.functions import ssi  # noqa: PLC0415

    with quietly():
        values = record.values
        hankel, _ = ssi.build_hank(values, values[references], rows, "cov")
        seen, a, c, _ = ssi.SSI_fast(hankel, rows, order, step=2)
        _, _, shapes, poles, *_ = ssi.SSI_poles(seen, a, c, order, 1.0 / record.even_hz, step=2, HC=False)
    orders = list(range(0, order + 1, 2))
    some = [np.isfinite(poles[:, i]) for i in range(len(orders))]
    found = [poles[keep, i] for i, keep in enumerate(some)]
    return table_of(found, [shapes[keep, i].T for i, keep in enumerate(some)], orders, "pyOMA2", record.dofs())


def koma_ssi(record: TimeSeries, rows: int, order: int) -> PoleTable:
    """Covariance-driven SSI of koma, orders in steps of two; all channels are references there."""
    from koma.oma import covssi  # noqa: PLC0415

    orders = np.arange(2, order + 1, 2)
    with quietly():
        poles, shapes, at = covssi(
            record.values.T, record.even_hz, rows, orders, showinfo=False, discard_conjugates=False
        )
    found = [poles[at == n] for n in orders]
    return table_of(found, [shapes[:, at == n] for n in orders], list(map(int, orders)), "koma", record.dofs())


def ema_lscf(frfs: FrfSet, order: int) -> PoleTable:
    """LSCF of sdypy-EMA up to an order, shapes of its poles by its own least-squares fit."""
    from sdypy import EMA  # noqa: PLC0415
    from sdypy.EMA.EMA import LSFD  # noqa: PLC0415

    lower, upper = float(frfs.freq_hz[0]), float(frfs.freq_hz[-1])
    with quietly():
        model = EMA.Model(
            frfs.values[:, 0], frfs.freq_hz, lower=lower, upper=upper, pol_order_high=order, frf_form="accelerance"
        )
        model.get_poles(method="lscf", show_progress=False)
    orders = list(range(2, order + 1, 2))
    found = [_upper_half(np.asarray(model.all_poles[n - 1]), lower, upper) for n in orders]
    shapes = [_shapes(LSFD, frfs, poles) for poles in found]
    return table_of(found, shapes, orders, "sdypy-EMA", frfs.responses)


def _upper_half(poles: NDArray, lower: float, upper: float) -> NDArray[np.complex128]:
    hz = np.abs(poles) / (2.0 * np.pi)
    return poles[(poles.imag > 0.0) & (poles.real < 0.0) & (hz >= lower) & (hz <= upper)]


def _shapes(fit: object, frfs: FrfSet, poles: NDArray) -> NDArray[np.complex128]:
    if not len(poles):
        return np.zeros((len(frfs.responses), 0), complex)
    with quietly():
        # pole by pole of one order together, as its select_poles does
        constants, *_ = fit(  # type: ignore[operator]
            poles, frfs.values[:, 0], frfs.freq_hz, True, True, 0, len(frfs.freq_hz), frf_form="accelerance"
        )
    return np.asarray(constants)
