"""Publications behind the methods: what ran is cited."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Citation:
    """One publication."""

    key: str
    text: str
    bibtex: str


PUBLICATIONS: dict[str, Citation] = {}


def _register(key: str, kind: str, **fields: str) -> None:
    body = ",\n".join(f"  {name} = {{{value}}}" for name, value in fields.items())
    source = fields.get("journal") or fields.get("publisher") or fields.get("booktitle", "")
    text = f"{fields['author']} ({fields['year']}), {fields['title']}, {source}"
    PUBLICATIONS[key] = Citation(key, text, f"@{kind}{{{key},\n{body}\n}}")


_register(
    "mottershead2011",
    "article",
    author="Mottershead, J. E. and Link, M. and Friswell, M. I.",
    title="The sensitivity method in finite element model updating: a tutorial",
    journal="Mechanical Systems and Signal Processing",
    volume="25",
    number="7",
    year="2011",
)
_register(
    "wald1940",
    "article",
    author="Wald, A. and Wolfowitz, J.",
    title="On a test whether two samples are from the same population",
    journal="Annals of Mathematical Statistics",
    volume="11",
    number="2",
    year="1940",
)
_register(
    "cochran1954",
    "article",
    author="Cochran, W. G.",
    title="The combination of estimates from different experiments",
    journal="Biometrics",
    volume="10",
    number="1",
    pages="101--129",
    year="1954",
)
_register(
    "dersimonian1986",
    "article",
    author="DerSimonian, R. and Laird, N.",
    title="Meta-analysis in clinical trials",
    journal="Controlled Clinical Trials",
    volume="7",
    number="3",
    pages="177--188",
    year="1986",
)
_register(
    "holm1979",
    "article",
    author="Holm, S.",
    title="A simple sequentially rejective multiple test procedure",
    journal="Scandinavian Journal of Statistics",
    volume="6",
    number="2",
    pages="65--70",
    year="1979",
)
_register(
    "sacks1989",
    "article",
    author="Sacks, J. and Welch, W. J. and Mitchell, T. J. and Wynn, H. P.",
    title="Design and analysis of computer experiments",
    journal="Statistical Science",
    volume="4",
    number="4",
    year="1989",
)
_register(
    "duchon1977",
    "incollection",
    author="Duchon, J.",
    title="Splines minimizing rotation-invariant semi-norms in Sobolev spaces",
    booktitle="Constructive theory of functions of several variables",
    publisher="Springer",
    pages="85--100",
    year="1977",
)
_register(
    "wahba1990",
    "book",
    author="Wahba, G.",
    title="Spline models for observational data",
    publisher="SIAM",
    year="1990",
)
_register(
    "blatman2011",
    "article",
    author="Blatman, G. and Sudret, B.",
    title="Adaptive sparse polynomial chaos expansion based on least angle regression",
    journal="Journal of Computational Physics",
    volume="230",
    number="6",
    pages="2345--2367",
    year="2011",
)
_register(
    "sudret2008",
    "article",
    author="Sudret, B.",
    title="Global sensitivity analysis using polynomial chaos expansions",
    journal="Reliability Engineering and System Safety",
    volume="93",
    number="7",
    pages="964--979",
    year="2008",
)
_register(
    "storn1997",
    "article",
    author="Storn, R. and Price, K.",
    title="Differential evolution: a simple and efficient heuristic for global optimization over continuous spaces",
    journal="Journal of Global Optimization",
    volume="11",
    year="1997",
)
_register(
    "deb2001",
    "book",
    author="Deb, K.",
    title="Multi-Objective Optimization using Evolutionary Algorithms",
    publisher="Wiley",
    year="2001",
)
_register(
    "deb2002",
    "article",
    author="Deb, K. and Pratap, A. and Agarwal, S. and Meyarivan, T.",
    title="A fast and elitist multiobjective genetic algorithm: {NSGA-II}",
    journal="IEEE Transactions on Evolutionary Computation",
    volume="6",
    pages="182--197",
    year="2002",
)
_register(
    "hansen2001",
    "article",
    author="Hansen, N. and Ostermeier, A.",
    title="Completely derandomized self-adaptation in evolution strategies",
    journal="Evolutionary Computation",
    volume="9",
    number="2",
    year="2001",
)
_register(
    "hedayat1999",
    "book",
    author="Hedayat, A. S. and Sloane, N. J. A. and Stufken, J.",
    title="Orthogonal Arrays: Theory and Applications",
    publisher="Springer",
    year="1999",
)
_register(
    "liu2017",
    "article",
    author="Liu, H. and Cai, J. and Ong, Y.-S.",
    title="An adaptive sampling approach for Kriging metamodeling by maximizing expected prediction error",
    journal="Computers and Chemical Engineering",
    volume="106",
    pages="171--182",
    year="2017",
)
_register(
    "morris1991",
    "article",
    author="Morris, M. D.",
    title="Factorial sampling plans for preliminary computational experiments",
    journal="Technometrics",
    volume="33",
    pages="161--174",
    year="1991",
)
_register(
    "campolongo2007",
    "article",
    author="Campolongo, F. and Cariboni, J. and Saltelli, A.",
    title="An effective screening design for sensitivity analysis of large models",
    journal="Environmental Modelling and Software",
    volume="22",
    pages="1509--1518",
    year="2007",
)
_register(
    "sobol2001",
    "article",
    author="Sobol', I. M.",
    title="Global sensitivity indices for nonlinear mathematical models and their Monte Carlo estimates",
    journal="Mathematics and Computers in Simulation",
    volume="55",
    pages="271--280",
    year="2001",
)
_register(
    "saltelli2010",
    "article",
    author="Saltelli, A. and Annoni, P. and Azzini, I. and Campolongo, F. and Ratto, M. and Tarantola, S.",
    title="Variance based sensitivity analysis of model output. Design and estimator for the total sensitivity index",
    journal="Computer Physics Communications",
    volume="181",
    pages="259--270",
    year="2010",
)
_register(
    "montgomery2017",
    "book",
    author="Montgomery, D. C.",
    title="Design and Analysis of Experiments",
    publisher="Wiley",
    year="2017",
)
_register(
    "plackett1946",
    "article",
    author="Plackett, R. L. and Burman, J. P.",
    title="The design of optimum multifactorial experiments",
    journal="Biometrika",
    volume="33",
    number="4",
    year="1946",
)
_register(
    "efron1993",
    "book",
    author="Efron, B. and Tibshirani, R. J.",
    title="An Introduction to the Bootstrap",
    publisher="Chapman and Hall",
    year="1993",
)
_register(
    "vehtari2024",
    "article",
    author="Vehtari, A. and Simpson, D. and Gelman, A. and Yao, Y. and Gabry, J.",
    title="Pareto Smoothed Importance Sampling",
    journal="Journal of Machine Learning Research",
    volume="25",
    year="2024",
)
_register(
    "ching2007",
    "article",
    author="Ching, J. and Chen, Y.-C.",
    title="Transitional Markov Chain Monte Carlo Method for Bayesian Model Updating, Model Class Selection, and Model "
    "Averaging",
    journal="Journal of Engineering Mechanics",
    volume="133",
    year="2007",
)
_register(
    "neal2011",
    "incollection",
    author="Neal, R. M.",
    title="MCMC Using Hamiltonian Dynamics",
    booktitle="Handbook of Markov Chain Monte Carlo",
    publisher="Chapman and Hall",
    year="2011",
)
_register(
    "meng1996",
    "article",
    author="Meng, X.-L. and Wong, W. H.",
    title="Simulating Ratios of Normalizing Constants via a Simple Identity: A Theoretical Exploration",
    journal="Statistica Sinica",
    volume="6",
    pages="831--860",
    year="1996",
)
_register(
    "wu1986",
    "article",
    author="Wu, C. F. J.",
    title="Jackknife, Bootstrap and Other Resampling Methods in Regression Analysis",
    journal="The Annals of Statistics",
    volume="14",
    number="4",
    pages="1261--1295",
    year="1986",
)
_register(
    "hesterberg2015",
    "article",
    author="Hesterberg, T. C.",
    title="What teachers should know about the bootstrap: resampling in the undergraduate statistics curriculum",
    journal="The American Statistician",
    volume="69",
    number="4",
    year="2015",
)
_register(
    "bard1974",
    "book",
    author="Bard, Y.",
    title="Nonlinear Parameter Estimation",
    publisher="Academic Press",
    year="1974",
)
_register(
    "belisle1993",
    "article",
    author="Bélisle, C. J. P. and Romeijn, H. E. and Smith, R. L.",
    title="Hit-and-run algorithms for generating multivariate distributions",
    journal="Mathematics of Operations Research",
    volume="18",
    pages="255--266",
    year="1993",
)
_register(
    "friswell1995",
    "book",
    author="Friswell, M. I. and Mottershead, J. E.",
    title="Finite Element Model Updating in Structural Dynamics",
    publisher="Kluwer",
    year="1995",
)
_register(
    "mottershead1996",
    "article",
    author="Mottershead, J. E. and Friswell, M. I. and Ng, G. H. T. and Brandon, J. A.",
    title="Geometric parameters for finite element model updating of joints and constraints",
    journal="Mechanical Systems and Signal Processing",
    volume="10",
    number="2",
    year="1996",
)
_register(
    "gladwell1995",
    "article",
    author="Gladwell, G. M. L. and Ahmadian, H.",
    title="Generic element matrices suitable for finite element model updating",
    journal="Mechanical Systems and Signal Processing",
    volume="9",
    number="6",
    year="1995",
)
_register(
    "allemang1982",
    "inproceedings",
    author="Allemang, R. J. and Brown, D. L.",
    title="A correlation coefficient for modal vector analysis",
    booktitle="Proceedings of the 1st International Modal Analysis Conference",
    year="1982",
)
_register(
    "lieven1988",
    "inproceedings",
    author="Lieven, N. A. J. and Ewins, D. J.",
    title="Spatial correlation of mode shapes, the coordinate modal assurance criterion (COMAC)",
    booktitle="Proceedings of the 6th International Modal Analysis Conference",
    year="1988",
)
_register(
    "hunt1992",
    "inproceedings",
    author="Hunt, D. L.",
    title="Application of an enhanced coordinate modal assurance criterion (ECOMAC)",
    booktitle="Proceedings of the 10th International Modal Analysis Conference",
    year="1992",
)
_register(
    "pascual1997",
    "inproceedings",
    author="Pascual, R. and Golinval, J. C. and Razeto, M.",
    title="A frequency domain correlation technique for model correlation and updating",
    booktitle="Proceedings of the 15th International Modal Analysis Conference",
    year="1997",
)
_register(
    "ocallahan1989",
    "inproceedings",
    author="O'Callahan, J. and Avitabile, P. and Riemer, R.",
    title="System equivalent reduction expansion process (SEREP)",
    booktitle="Proceedings of the 7th International Modal Analysis Conference",
    year="1989",
)
_register(
    "kidder1973",
    "article",
    author="Kidder, R. L.",
    title="Reduction of structural frequency equations",
    journal="AIAA Journal",
    volume="11",
    number="6",
    year="1973",
)
_register(
    "balmes2000",
    "inproceedings",
    author="Balmès, E.",
    title="Review and evaluation of shape expansion methods",
    booktitle="Proceedings of the 18th International Modal Analysis Conference",
    year="2000",
)
_register(
    "heylen1996",
    "inproceedings",
    author="Heylen, W. and Lammens, S.",
    title="FRAC: a consistent way of comparing frequency response functions",
    booktitle="Proceedings of the International Conference on Identification in Engineering Systems, Swansea",
    year="1996",
)
_register(
    "dvorkin1984",
    "article",
    author="Dvorkin, E. N. and Bathe, K.-J.",
    title="A continuum mechanics based four-node shell element for general nonlinear analysis",
    journal="Engineering Computations",
    volume="1",
    year="1984",
)
_register(
    "pian1984",
    "article",
    author="Pian, T. H. H. and Sumihara, K.",
    title="Rational approach for assumed stress finite elements",
    journal="International Journal for Numerical Methods in Engineering",
    volume="20",
    year="1984",
)
_register(
    "lee2004",
    "article",
    author="Lee, P.-S. and Bathe, K.-J.",
    title="Development of MITC isotropic triangular shell finite elements",
    journal="Computers and Structures",
    volume="82",
    year="2004",
)
_register(
    "allman1984",
    "article",
    author="Allman, D. J.",
    title="A compatible triangular element including vertex rotations for plane elasticity analysis",
    journal="Computers and Structures",
    volume="19",
    year="1984",
)
_register(
    "bathe1986",
    "article",
    author="Bathe, K.-J. and Dvorkin, E. N.",
    title="A formulation of general shell elements: the use of mixed interpolation of tensorial components",
    journal="International Journal for Numerical Methods in Engineering",
    volume="22",
    year="1986",
)
_register(
    "macneal1992",
    "article",
    author="MacNeal, R. H. and Harder, R. L.",
    title="Eight nodes or nine?",
    journal="International Journal for Numerical Methods in Engineering",
    volume="33",
    year="1992",
)
_register(
    "bathe1989",
    "article",
    author="Bathe, K.-J. and Brezzi, F. and Cho, S. W.",
    title="The MITC7 and MITC9 plate bending elements",
    journal="Computers and Structures",
    volume="32",
    year="1989",
)
_register(
    "neunteufel2021",
    "article",
    author="Neunteufel, M. and Schoberl, J.",
    title="Avoiding membrane locking with Regge interpolation",
    journal="Computer Methods in Applied Mechanics and Engineering",
    volume="373",
    year="2021",
)
_register(
    "fox1968",
    "article",
    author="Fox, R. L. and Kapoor, M. P.",
    title="Rates of change of eigenvalues and eigenvectors",
    journal="AIAA Journal",
    volume="6",
    number="12",
    year="1968",
)
_register(
    "dailey1989",
    "article",
    author="Dailey, R. L.",
    title="Eigenvector derivatives with repeated eigenvalues",
    journal="AIAA Journal",
    volume="27",
    number="4",
    year="1989",
)
_register(
    "guyan1965",
    "article",
    author="Guyan, R. J.",
    title="Reduction of stiffness and mass matrices",
    journal="AIAA Journal",
    volume="3",
    number="2",
    year="1965",
)
_register(
    "khodaparast2008",
    "article",
    author="Khodaparast, H. H. and Mottershead, J. E. and Friswell, M. I.",
    title="Perturbation methods for the estimation of parameter variability in stochastic model updating",
    journal="Mechanical Systems and Signal Processing",
    volume="22",
    number="8",
    year="2008",
)
_register(
    "govers2010",
    "article",
    author="Govers, Y. and Link, M.",
    title="Stochastic model updating: covariance matrix adjustment from uncertain experimental modal data",
    journal="Mechanical Systems and Signal Processing",
    volume="24",
    number="3",
    year="2010",
)
_register(
    "silva2016",
    "article",
    author="Silva, T. A. N. and Maia, N. M. M. and Link, M. and Mottershead, J. E.",
    title="Parameter selection and covariance updating",
    journal="Mechanical Systems and Signal Processing",
    volume="70-71",
    year="2016",
)
_register(
    "iman1982",
    "article",
    author="Iman, R. L. and Conover, W. J.",
    title="A distribution-free approach to inducing rank correlation among input variables",
    journal="Communications in Statistics: Simulation and Computation",
    volume="11",
    number="3",
    year="1982",
)
_register(
    "dempster1977",
    "article",
    author="Dempster, A. P. and Laird, N. M. and Rubin, D. B.",
    title="Maximum likelihood from incomplete data via the EM algorithm",
    journal="Journal of the Royal Statistical Society B",
    volume="39",
    number="1",
    year="1977",
)
_register(
    "mckelvey1996",
    "article",
    author="McKelvey, T. and Akcay, H. and Ljung, L.",
    title="Subspace-based multivariable system identification from frequency response data",
    journal="IEEE Transactions on Automatic Control",
    volume="41",
    number="7",
    year="1996",
)
_register(
    "guillaume2003",
    "inproceedings",
    author="Guillaume, P. and Verboven, P. and Vanlanduit, S. and Van der Auweraer, H. and Peeters, B.",
    title="A poly-reference implementation of the least-squares complex frequency-domain estimator",
    booktitle="Proceedings of the 21st International Modal Analysis Conference",
    year="2003",
)
_register(
    "cauberghe2005",
    "article",
    author="Cauberghe, B. and Guillaume, P. and Verboven, P. and Vanlanduit, S. and Parloo, E.",
    title="On the influence of the parameter constraint on the stability of the poles and the discrimination "
    "capabilities of the stabilisation diagrams",
    journal="Mechanical Systems and Signal Processing",
    volume="19",
    number="5",
    year="2005",
)
_register(
    "reynders2012",
    "article",
    author="Reynders, E. and Houbrechts, J. and De Roeck, G.",
    title="Fully automated (operational) modal analysis",
    journal="Mechanical Systems and Signal Processing",
    volume="29",
    year="2012",
)
_register(
    "golub1973",
    "article",
    author="Golub, G. H. and Pereyra, V.",
    title="The differentiation of pseudo-inverses and nonlinear least squares problems whose variables separate",
    journal="SIAM Journal on Numerical Analysis",
    volume="10",
    number="2",
    year="1973",
)
_register(
    "birge1932",
    "article",
    author="Birge, R. T.",
    title="The calculation of errors by the method of least squares",
    journal="Physical Review",
    volume="40",
    year="1932",
)
_register(
    "schwarz1978",
    "article",
    author="Schwarz, G.",
    title="Estimating the dimension of a model",
    journal="The Annals of Statistics",
    volume="6",
    number="2",
    pages="461--464",
    year="1978",
)
_register(
    "beck2004",
    "article",
    author="Beck, J. L. and Yuen, K.-V.",
    title="Model selection using response measurements: Bayesian probabilistic approach",
    journal="Journal of Engineering Mechanics",
    volume="130",
    number="2",
    pages="192--203",
    year="2004",
)
_register(
    "goulet2013",
    "article",
    author="Goulet, J.-A. and Smith, I. F. C.",
    title="Structural identification with systematic errors and unknown uncertainty dependencies",
    journal="Computers and Structures",
    volume="128",
    pages="251--258",
    year="2013",
)
_register(
    "kammer1991",
    "article",
    author="Kammer, D. C.",
    title="Sensor placement for on-orbit modal identification and correlation of large space structures",
    journal="Journal of Guidance, Control, and Dynamics",
    volume="14",
    number="2",
    pages="251--259",
    year="1991",
)
_register(
    "kammer2004",
    "article",
    author="Kammer, D. C. and Tinker, M. L.",
    title="Optimal placement of triaxial accelerometers for modal vibration tests",
    journal="Mechanical Systems and Signal Processing",
    volume="18",
    number="1",
    pages="29--41",
    year="2004",
)
_register(
    "kammer2005",
    "article",
    author="Kammer, D. C.",
    title="Sensor set expansion for modal vibration testing",
    journal="Mechanical Systems and Signal Processing",
    volume="19",
    number="4",
    pages="700--713",
    year="2005",
)
_register(
    "fedorov1972",
    "book",
    author="Fedorov, V. V.",
    title="Theory of Optimal Experiments",
    publisher="Academic Press",
    year="1972",
)
_register(
    "williams1985",
    "inproceedings",
    author="Williams, R. and Crowley, J. and Vold, H.",
    title="The multivariate mode indicator function in modal analysis",
    booktitle="Proceedings of the 3rd International Modal Analysis Conference",
    pages="66--70",
    year="1985",
)
_register(
    "atkinson2007",
    "book",
    author="Atkinson, A. C. and Donev, A. N. and Tobias, R. D.",
    title="Optimum Experimental Designs, with SAS",
    publisher="Oxford University Press",
    year="2007",
)


def citation(key: str) -> Citation:
    """The publication registered under `key` (KeyError if there is none)."""
    return PUBLICATIONS[key]
