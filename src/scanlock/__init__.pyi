# The public names of scanlock, once: read by type checkers, editors and the lazy import. Each
# group is a section of docs/api/index.md.

# Register, assess
from scanlock.registration.register import register as register
from scanlock.registration.assess import assess as assess
from scanlock.registration.prepare import prepare as prepare
from scanlock.registration.prepare import PreparedScan as PreparedScan
from scanlock.registration.warm_up import warm_up as warm_up

# Results
from scanlock.registration.result import RegistrationResult as RegistrationResult
from scanlock.registration.verification.status import Status as Status
from scanlock.registration.verification.metrics import Metrics as Metrics
from scanlock.registration.verification.observability import (
    DirectionObservability as DirectionObservability,
)
from scanlock.registration.verification.candidate import Candidate as Candidate
from scanlock.registration.uncertainty.accuracy import PoseAccuracy as PoseAccuracy
from scanlock.registration.uncertainty.pose_covariance import PoseCovariance as PoseCovariance
from scanlock.registration.local_origins import LocalOrigins as LocalOrigins

# Scans, poses, constraints
from scanlock.clouds.point_cloud import PointCloud as PointCloud
from scanlock.geometry.pose import Pose as Pose
from scanlock.optimisation.objectives.constraints import Constraints as Constraints
from scanlock.optimisation.objectives.constraints import PosePrior as PosePrior
from scanlock.registration.uncertainty.covariance_estimator import (
    CovarianceEstimator as CovarianceEstimator,
)

# Methods
from scanlock.registration.registry import METHODS as METHODS
from scanlock.registration.methods.auto.auto import Auto as Auto
from scanlock.registration.methods.sgc_ndt import SgcNdt as SgcNdt
from scanlock.registration.methods.ndt import Ndt as Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d as NdtD2d
from scanlock.registration.methods.mskm_ndt import MskmNdt as MskmNdt
from scanlock.registration.methods.gicp import Gicp as Gicp
from scanlock.registration.methods.icp.icp import Icp as Icp

# Parts of methods
from scanlock.registration.methods.icp.correspondences import (
    NearestNeighbourSearch as NearestNeighbourSearch,
)
from scanlock.registration.methods.icp.correspondences import VoxelSearch as VoxelSearch
from scanlock.registration.methods.icp.distance_rejection import (
    FixedRejection as FixedRejection,
    TrimmedRejection as TrimmedRejection,
    AdaptiveRejection as AdaptiveRejection,
)
from scanlock.optimisation.objectives.robust_weights import RobustWeights as RobustWeights
from scanlock.registration.methods.icp.transform_estimation import (
    TransformEstimation as TransformEstimation,
)
from scanlock.registration.methods.icp.annealing import AnnealedStart as AnnealedStart
from scanlock.registration.methods.icp.history import (
    IcpConvergenceCriteria as IcpConvergenceCriteria,
)
from scanlock.registration.methods.coarse_to_fine import CoarseToFine as CoarseToFine
from scanlock.registration.methods.coarse_to_fine import Scale as Scale
from scanlock.registration.methods.coarse_to_fine import PAPER_SCALES as PAPER_SCALES
from scanlock.registration.methods.auto.multi_start import MultiStart as MultiStart
from scanlock.registration.methods.fine_ndt import FineNdt as FineNdt
from scanlock.registration.methods.sparse_refinement import SparseRefinement as SparseRefinement
from scanlock.registration.search.bev_correlation import BevSearch as BevSearch
from scanlock.registration.search.cluster_matching import ClusterMatcher as ClusterMatcher
from scanlock.segmentation.cluster_gaussians import (
    ClusterGaussianExtractor as ClusterGaussianExtractor,
)
from scanlock.models.voxel_gaussians import VoxelGrid as VoxelGrid

# Settings files
from scanlock.registration.settings.file import read_settings as read_settings
from scanlock.registration.settings.file import write_settings as write_settings

# Your own methods
from scanlock.registration.methods.protocol import Method as Method
from scanlock.registration.methods.protocol import InsufficientData as InsufficientData
from scanlock.registration.methods.protocol import PreparationLog as PreparationLog
from scanlock.registration.registry import register_method as register_method
from scanlock.clouds.point_tree import PointTree as PointTree
from scanlock.clouds.voxel_grid import voxel_means as voxel_means
from scanlock.models.surfaces import surface_normals as surface_normals

# Sequences
from scanlock.pipelines.odometry import odometry as odometry
from scanlock.pipelines.odometry import OdometryStep as OdometryStep

# Many pairs
from scanlock.pipelines.many.register_many import register_many as register_many
from scanlock.pipelines.many.pair import Pair as Pair
from scanlock.pipelines.many.pair import read_pairs as read_pairs
from scanlock.pipelines.many.pair_row import PairRow as PairRow
from scanlock.pipelines.many.pair_row import PairRows as PairRows

# Ground and clusters
from scanlock.segmentation.segmentation import segment as segment
from scanlock.segmentation.segmentation import Segmentation as Segmentation
from scanlock.segmentation.segmentation import Segmenter as Segmenter
from scanlock.segmentation.ground.finder import GroundFinder as GroundFinder
from scanlock.segmentation.ground.finder import PublishedGroundFinder as PublishedGroundFinder
from scanlock.segmentation.clusters import ClusterFinder as ClusterFinder
from scanlock.segmentation.clusters import GaussianFit as GaussianFit
from scanlock.segmentation.clusters import L2Distance as L2Distance
from scanlock.segmentation.clusters import MeanDistance as MeanDistance

# Pictures
from scanlock.report.registration_figure import registration_figure as registration_figure

# Files
from scanlock.io import read_scan as read_scan
from scanlock.io import write_scan as write_scan
from scanlock.io import read_scans as read_scans
from scanlock.io import write_scans as write_scans
from scanlock.io import write_e57_poses as write_e57_poses
from scanlock.io import ScanFile as ScanFile
from scanlock.io import transform_scan as transform_scan
from scanlock.io import merge_scans as merge_scans
from scanlock.io import read_pose as read_pose
from scanlock.io import write_pose as write_pose

# Errors
from scanlock.errors import ScanlockError as ScanlockError
from scanlock.errors import InvalidInput as InvalidInput
from scanlock.errors import FormatError as FormatError
from scanlock.errors import MissingExtra as MissingExtra

# Packages
from scanlock import io as io
from scanlock import simulation as simulation
from scanlock.optimisation import solvers as solvers
from scanlock.optimisation import objectives as objectives

__version__: str
__all__: list[str]
