"""The live model of the report as records."""

from __future__ import annotations

from typing import Literal

from femtune.modal.kinds import FrfKind
from femtune.residuals.kinds import FrfForm
from femtune.study.record import Record

LiveQuantity = Literal["frequency", "shape", "mac"]
"""What a residual of the page compares."""


class LiveParameter(Record):
    """A parameter that the reader of the report can change."""

    name: str
    """Name of the parameter."""
    unit: str
    """Unit of its values; "" for a factor."""
    nominal: float
    """Initial value, in `unit`."""
    updated: float
    """Result of the update."""
    lower: float
    """Lower end of its range: the bound, if the ranges are not `narrowed`."""
    upper: float
    """Upper end of its range."""
    scale: float
    """Value = nominal + scale · x, with the normalised parameter x."""
    interval_95: tuple[float, float] | None = None
    """95 % interval of the update; None where it gives none."""


class LiveRegion(Record):
    """The 95 % region of the parameters: points x with |A (x − x̂) + b|² at most `limit`."""

    moving: tuple[int, ...]
    """Positions of the parameters that have a distribution."""
    at_key: str
    """Key of x̂ (moving,), normalised."""
    rows_key: str
    """Key of A (m, moving)."""
    offset_key: str
    """Key of b (m,)."""
    limit: float
    """Value of |A (x − x̂) + b|² that 95 % of the distribution within the bounds are below."""
    centre_key: str
    """Key of the middle of the region (moving,), normalised."""
    precision_key: str
    """Key of H (moving, moving): the region is (x − centre)ᵀH(x − centre) at most `radius_square`, and the bounds."""
    radius_square: float
    """Limit of that form."""


class LiveFactor(Record):
    """Actual over stated standard deviation with which the residuals of a kind count."""

    kind: str
    """Label of the kind of residual."""
    factor: float
    """The factor."""


class LiveDraws(Record):
    """Values of the parameters from which a page chooses models that the data allow."""

    source: Literal["posterior", "linear"]
    """"posterior": samples that have equal weights. "linear": samples of the linearised distribution, which the page
    weighs by the true χ²."""
    x_key: str
    """Key of the values (n, k), normalised."""
    linear_key: str | None = None
    """Key of |A (x − x̂) + b|² at each (n,); None for samples of equal weights."""
    degrees: float | None = None
    """Degrees of freedom of the linearised distribution; None for a normal one."""
    factors: tuple[LiveFactor, ...] = ()
    """Factors on the stated standard deviations; kinds that count as stated are not in it."""
    reason: str = ""
    """Why samples of the linearised distribution are not weighed; "" where they are."""


class LiveTermRecord(Record):
    """A matrix of the live model and the polynomial that multiplies it."""

    kind: Literal["stiffness", "mass"]
    """Matrix that it is a part of."""
    parameters: tuple[int, ...]
    """Positions of the parameters that it depends on."""
    shape: tuple[int, ...]
    """Number of Chebyshev coefficients in each of them."""
    first: int
    """Position of the first coefficient in `polynomials_key`."""
    scale: float
    """Factor on the stored entries of the matrix."""


class LivePair(Record):
    """A test mode and the modes of the updated model that it is compared with."""

    test: int
    """Position of the test mode."""
    mode: int
    """Position of its partner at the updated point; of close modes the one of the same rank."""
    modes: tuple[int, ...]
    """Positions of all modes of the model that span its motion: several for close modes that are compared as one
    subspace. Pairs of rigid-body modes are left out."""


class LivePart(Record):
    """Residuals of one pair, which the page computes itself."""

    kind: str
    """Label of the kind of residual."""
    quantity: LiveQuantity
    """What is compared."""
    form: str
    """Form of the residual: "frequency" or "eigenvalue"; the scaling of a shape; the form of a MAC."""
    test: int
    """Position of the test mode."""
    sd: float
    """Standard deviation; 1 where `weights_first` is given."""
    sensors: tuple[int, ...] = ()
    """Rows of the sensors whose entries are compared, if not all."""
    weights_first: int | None = None
    """Position in `weights_key` of the first entry of the square matrix that makes residuals of the differences of a
    shape; None where all are divided by `sd`."""
    weights_size: int = 0
    """Rows of that matrix."""
    common: float = 0.0
    """Change of the residual by the relative error that all frequencies share, of one standard deviation."""


class LiveOtherPart(Record):
    """Residuals that the page does not compute again."""

    kind: str
    """Label of the kind of residual."""
    chi_square: float
    """Sum of squares at the updated point."""


class LiveCheck(Record):
    """A point at which the page checks its own solution before it shows any."""

    x_key: str
    """Key of the normalised parameters (k,)."""
    eigenvalues_key: str
    """Key of the eigenvalues there, in rad²/s²."""
    chi_square: float
    """Sum of squares of the residuals of modes that the page computes for this configuration, paired as at the
    update."""
    functions: tuple[float, ...] = ()
    """Sum of the squares of the magnitudes of the functions of each entry of `functions`."""


class LiveFunctionErrors(Record):
    """Largest difference of FRFs between a live model and the full one."""

    points: int
    """Points at which both were solved."""
    percent: float
    """Largest of all functions and points: root of the sum of squares of the differences over the lines, relative to
    that of the function of the full model, in %; 1e9 where the live model has no modes."""
    function: str = ""
    """The function with this difference, "output by input"."""


class LiveFunctions(Record):
    """Measured FRFs of a configuration, beside which the page draws those of the live model."""

    kind: FrfKind
    """Receptance, mobility or accelerance."""
    unit: str
    """Their unit."""
    look: Literal["test", "equalised"]
    """"equalised" where the test is compared with equal damping."""
    outputs: tuple[str, ...]
    """Labels of the outputs."""
    inputs: tuple[str, ...]
    """Labels of the inputs."""
    freq_key: str
    """Key of the lines in Hz."""
    every: int
    """Every n-th line of the test is taken."""
    test_values_key: str
    """Key of the test (outputs, inputs, lines); NaN where nothing is compared."""
    outputs_key: str
    """Key of the motion of the outputs (outputs, order)."""
    inputs_key: str
    """Key of the forces of unit inputs (inputs, order)."""
    modes: int
    """Modes that are superposed; of all others the response far below their frequencies is added."""
    damping: str
    """What damps them, in words."""
    damping_ratios: tuple[float, ...]
    """Damping ratios by mode, the last one also of those above; a table with `damping_hz`."""
    damping_hz: tuple[float, ...] = ()
    """Natural frequencies of the table."""
    hysteretic: bool = False
    """Whether the damping of a mode is an imaginary stiffness."""
    loss_factor: float = 0.0
    """Loss factor of the whole stiffness."""
    label: str = ""
    """Kind of the residual; "" where the update did not compare these functions."""
    form: FrfForm = "log-complex"
    """Form of the residual."""
    sd_key: str | None = None
    """Key of the standard deviations of the residual (outputs, inputs, lines); None where the page does not compute
    its χ²."""
    shift_key: str | None = None
    """Key of what is added to logarithms of magnitudes; None where nothing is."""
    region: LiveFunctionErrors | None = None
    """Differences in the 95 % region."""
    bounds: LiveFunctionErrors | None = None
    """Differences within the ranges of the parameters."""


class LiveCertificate(Record):
    """Largest differences between a live model and another one at points where both were solved."""

    compared_with: Literal["full model", "reduced model"]
    """The other model."""
    compared_order: int
    """Order of its matrices."""
    points: int
    """Number of points."""
    corners: int
    """How many of them are corners of the ranges of the parameters."""
    without_modes: int
    """At how many of them neither model has modes, such as where a motion has no stiffness."""
    frequency_percent: float
    """Largest difference of a frequency, in %; 1e9 where only one of both models has modes."""
    mac: float | None
    """Largest difference of the MAC of a pair; None without measured shapes. Modes closer than 0.1 % in frequency are
    compared as one subspace."""
    mac_pairs: int
    """Number of MACs that were compared."""
    chi_square_percent: float | None
    """Largest difference of the sum of squares of the residuals of modes that the page computes for this configuration,
    in % of that of the other model, which counts at least as 1; None where the page computes none."""


class LiveWeighed(Record):
    """A mass that was weighed."""

    mass: float
    """The measured mass, in the unit of mass."""
    sd: float
    """Its standard deviation, in the unit of mass."""


class LiveMass(Record):
    """The mass of a configuration as a function of the parameters."""

    updated: float
    """At the updated point, in the unit of mass."""
    slopes: tuple[float, ...]
    """Change of the mass by the value of the polynomial of each mass matrix in `terms`, in their order."""
    weighed: tuple[LiveWeighed, ...] = ()
    """Masses that the update compares, if the page computes their part of χ²."""


class LiveReducedMass(Record):
    """Mass reduced to the sensors by the page, with which it computes criteria of orthogonality."""

    sensors: tuple[int, ...]
    """Positions of the sensors that are kept; others only repeat these."""
    points: int
    """Points at which it was compared with that of the full model."""
    difference: float
    """Largest difference of an orthogonality there, of test shapes with each other and with those of the model."""


class LiveConfiguration(Record):
    """The live model of one configuration."""

    configuration: str
    """Name of the configuration."""
    order: int
    """Order of the matrices in the page."""
    dofs: int
    """Degrees of freedom of the full model."""
    count: int
    """Modes that are shown."""
    shift: float
    """σ in rad²/s²: K − σM is positive definite."""
    theta_key: str
    """Key of θ = 1/(λ − σ) of the live model at the updated point (order,), in s²/rad²."""
    terms: tuple[LiveTermRecord, ...]
    """Matrices that change with the parameters."""
    triangles_key: str
    """Key of their upper triangles by rows (terms, order (order + 1)/2), of masses relative to √(θ_a θ_b), θ
    counting at least as a millionth of the largest one."""
    polynomials_key: str
    """Key of all Chebyshev coefficients."""
    sensors_key: str
    """Key of the motion of the sensors (sensors, order)."""
    mass_points: tuple[str, ...] = ()
    """Points of sensors at which a mass can be added, "grid 101": all where the live model has all degrees of freedom
    of the model, else some."""
    mass_reason: str = ""
    """Why no mass can be added; "" where one can, and in older results."""
    mass_rows_key: str | None = None
    """Key of the translations of these points (points, 3, order)."""
    drawing_key: str | None = None
    """Key of the vectors that shapes are drawn with (points, 3, vectors), steps of 8 bits; None where nothing is
    drawn."""
    drawing_weights_key: str | None = None
    """Key of their parts in the coordinates of the live model (vectors, order)."""
    test_labels: tuple[str, ...]
    """Test modes."""
    test_freq_hz: tuple[float, ...]
    """Their frequencies in Hz."""
    sensor_labels: tuple[str, ...] = ()
    """Labels of the sensors."""
    test_shapes_key: str
    """Key of their shapes (sensors, test modes); NaN where not measured."""
    pairs: tuple[LivePair, ...]
    """Pairs at the updated point."""
    parts: tuple[LivePart, ...]
    """Residuals that the page computes."""
    weights_key: str
    """Key of the weights of shapes."""
    region: LiveCertificate | None
    """Differences in the 95 % region from the model that the live one was made of; None where the update gives no
    distribution."""
    bounds: LiveCertificate
    """The same within the ranges of the parameters, with corners."""
    region_full: LiveCertificate | None = None
    """Differences from the full model in the 95 % region; None where it is the model that the live one was made of, and
    without a region."""
    bounds_full: LiveCertificate | None = None
    """The same within the ranges of the parameters."""
    checks: tuple[LiveCheck, ...]
    """Points that the page checks."""
    mass: LiveMass | None = None
    """The mass; None where it does not change with the parameters or is not followed."""
    reduced_mass: LiveReducedMass | None = None
    """The mass at the sensors; None where criteria of orthogonality are not asked for, or keep the values of the
    update."""
    functions: tuple[LiveFunctions, ...] = ()
    """Measured FRFs that are drawn beside those of the live model."""
    functions_reason: str = ""
    """Why some or all measured FRFs are not computed again; "" where all are, or none were measured."""


class LiveResults(Record):
    """A model small enough to be solved in the report."""

    reason: str = ""
    """Why there is none; "" where there is one."""
    parameters: tuple[LiveParameter, ...] = ()
    """Parameters that can be changed."""
    narrowed: str = ""
    """Why their ranges are narrower than the bounds; "" where they are the bounds."""
    x_key: str | None = None
    """Key of the updated point (k,), normalised."""
    region: LiveRegion | None = None
    """The 95 % region; None where the update gives no distribution."""
    draws: LiveDraws | None = None
    """Models that the data allow; None where the update gives no distribution."""
    configurations: tuple[LiveConfiguration, ...] = ()
    """One live model a configuration."""
    others: tuple[LiveOtherPart, ...] = ()
    """Residuals that keep the values of the update."""
    solutions: int = 0
    """Solutions of the full model that were made for it."""
