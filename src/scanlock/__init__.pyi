# The public names of scanlock, once: read by type checkers, editors and the lazy import.

# Register, prepare, assess
# Packages
from scanlock import io as io
from scanlock import simulation as simulation

# Scans, poses, constraints
from scanlock.clouds.point_cloud import PointCloud as PointCloud

# Errors
from scanlock.errors import FormatError as FormatError
from scanlock.errors import InvalidInput as InvalidInput
from scanlock.errors import MissingExtra as MissingExtra
from scanlock.errors import ScanlockError as ScanlockError
from scanlock.geometry.pose import Pose as Pose

# Files
from scanlock.io import read_pose as read_pose
from scanlock.io import read_scan as read_scan
from scanlock.io import write_pose as write_pose
from scanlock.io import write_scan as write_scan
from scanlock.optimisation import objectives as objectives
from scanlock.optimisation import solvers as solvers
from scanlock.optimisation.objectives.constraints import Constraints as Constraints
from scanlock.optimisation.objectives.constraints import PosePrior as PosePrior

# Sequences
from scanlock.pipelines.odometry import OdometryStep as OdometryStep
from scanlock.pipelines.odometry import odometry as odometry
from scanlock.registration.assess import assess as assess

# Results
from scanlock.registration.local_origins import LocalOrigins as LocalOrigins

# Methods
from scanlock.registration.methods.auto import Auto as Auto
from scanlock.registration.methods.gicp import Gicp as Gicp
from scanlock.registration.methods.icp import Icp as Icp
from scanlock.registration.methods.mskm_ndt import MskmNdt as MskmNdt
from scanlock.registration.methods.ndt import Ndt as Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d as NdtD2d

# Your own methods
from scanlock.registration.methods.protocol import InsufficientData as InsufficientData
from scanlock.registration.methods.protocol import Method as Method
from scanlock.registration.methods.protocol import PreparationLog as PreparationLog
from scanlock.registration.methods.sgc_ndt import SgcNdt as SgcNdt
from scanlock.registration.prepare import PreparedScan as PreparedScan
from scanlock.registration.prepare import prepare as prepare
from scanlock.registration.register import register as register
from scanlock.registration.registry import METHODS as METHODS
from scanlock.registration.registry import register_method as register_method
from scanlock.registration.result import RegistrationResult as RegistrationResult
from scanlock.registration.settings.file import read_settings as read_settings
from scanlock.registration.settings.file import write_settings as write_settings
from scanlock.registration.uncertainty.covariance_estimator import (
    CovarianceEstimator as CovarianceEstimator,
)
from scanlock.registration.uncertainty.pose_covariance import PoseCovariance as PoseCovariance
from scanlock.registration.verification.candidate import Candidate as Candidate
from scanlock.registration.verification.metrics import Metrics as Metrics
from scanlock.registration.verification.observability import (
    DirectionObservability as DirectionObservability,
)
from scanlock.registration.verification.status import Status as Status
from scanlock.registration.warm_up import warm_up as warm_up

# Segmentation
from scanlock.segmentation.clusters import ClusterFinder as ClusterFinder
from scanlock.segmentation.ground.finder import GroundFinder as GroundFinder
from scanlock.segmentation.ground.finder import PublishedGroundFinder as PublishedGroundFinder
from scanlock.segmentation.segmentation import Segmentation as Segmentation
from scanlock.segmentation.segmentation import Segmenter as Segmenter
from scanlock.segmentation.segmentation import segment as segment

__version__: str
__all__: list[str]
