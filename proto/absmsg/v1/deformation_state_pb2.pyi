from absmsg.v1 import common_pb2 as _common_pb2
from absmsg.v1 import sensor_model_pb2 as _sensor_model_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class DeformationState(_message.Message):
    __slots__ = ("header", "tracker", "status", "reasons", "model", "model_id", "calib_id", "theta", "log_likelihood", "search_deviation", "generations", "evaluations", "solve_ms", "age_ms", "skipped", "mesh_version", "sensors", "inlier_share", "covariance", "covariance_valid", "samples", "clock_sigma_ns", "searcher", "stop", "budget_evaluations", "budget_ms", "stretch", "folded_share", "deviation_m", "warnings", "derived", "age_error_ms")
    class Status(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STATUS_UNSPECIFIED: _ClassVar[DeformationState.Status]
        STATUS_INITIALIZING: _ClassVar[DeformationState.Status]
        STATUS_TRACKING: _ClassVar[DeformationState.Status]
        STATUS_DEGRADED: _ClassVar[DeformationState.Status]
        STATUS_LOST: _ClassVar[DeformationState.Status]
    STATUS_UNSPECIFIED: DeformationState.Status
    STATUS_INITIALIZING: DeformationState.Status
    STATUS_TRACKING: DeformationState.Status
    STATUS_DEGRADED: DeformationState.Status
    STATUS_LOST: DeformationState.Status
    class Stop(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        STOP_UNSPECIFIED: _ClassVar[DeformationState.Stop]
        STOP_CONVERGED: _ClassVar[DeformationState.Stop]
        STOP_GENERATIONS: _ClassVar[DeformationState.Stop]
        STOP_EVALUATIONS: _ClassVar[DeformationState.Stop]
        STOP_TIME: _ClassVar[DeformationState.Stop]
    STOP_UNSPECIFIED: DeformationState.Stop
    STOP_CONVERGED: DeformationState.Stop
    STOP_GENERATIONS: DeformationState.Stop
    STOP_EVALUATIONS: DeformationState.Stop
    STOP_TIME: DeformationState.Stop
    class Sensor(_message.Message):
        __slots__ = ("sensor", "seq", "t_host_ns", "samples", "mean_log_likelihood", "normalized_residual", "missing", "dropped", "visible", "occluded", "rim_visible", "rim_outside", "rim_inside", "rim_occluded", "agreeing_share", "disagreeing_share", "no_return_share", "occluder_share", "self_occluded_share", "outside_share", "unexplained_share", "unexplained_at_first")
        SENSOR_FIELD_NUMBER: _ClassVar[int]
        SEQ_FIELD_NUMBER: _ClassVar[int]
        T_HOST_NS_FIELD_NUMBER: _ClassVar[int]
        SAMPLES_FIELD_NUMBER: _ClassVar[int]
        MEAN_LOG_LIKELIHOOD_FIELD_NUMBER: _ClassVar[int]
        NORMALIZED_RESIDUAL_FIELD_NUMBER: _ClassVar[int]
        MISSING_FIELD_NUMBER: _ClassVar[int]
        DROPPED_FIELD_NUMBER: _ClassVar[int]
        VISIBLE_FIELD_NUMBER: _ClassVar[int]
        OCCLUDED_FIELD_NUMBER: _ClassVar[int]
        RIM_VISIBLE_FIELD_NUMBER: _ClassVar[int]
        RIM_OUTSIDE_FIELD_NUMBER: _ClassVar[int]
        RIM_INSIDE_FIELD_NUMBER: _ClassVar[int]
        RIM_OCCLUDED_FIELD_NUMBER: _ClassVar[int]
        AGREEING_SHARE_FIELD_NUMBER: _ClassVar[int]
        DISAGREEING_SHARE_FIELD_NUMBER: _ClassVar[int]
        NO_RETURN_SHARE_FIELD_NUMBER: _ClassVar[int]
        OCCLUDER_SHARE_FIELD_NUMBER: _ClassVar[int]
        SELF_OCCLUDED_SHARE_FIELD_NUMBER: _ClassVar[int]
        OUTSIDE_SHARE_FIELD_NUMBER: _ClassVar[int]
        UNEXPLAINED_SHARE_FIELD_NUMBER: _ClassVar[int]
        UNEXPLAINED_AT_FIRST_FIELD_NUMBER: _ClassVar[int]
        sensor: str
        seq: int
        t_host_ns: int
        samples: int
        mean_log_likelihood: float
        normalized_residual: float
        missing: bool
        dropped: int
        visible: int
        occluded: int
        rim_visible: int
        rim_outside: int
        rim_inside: int
        rim_occluded: int
        agreeing_share: float
        disagreeing_share: float
        no_return_share: float
        occluder_share: float
        self_occluded_share: float
        outside_share: float
        unexplained_share: float
        unexplained_at_first: float
        def __init__(self, sensor: _Optional[str] = ..., seq: _Optional[int] = ..., t_host_ns: _Optional[int] = ..., samples: _Optional[int] = ..., mean_log_likelihood: _Optional[float] = ..., normalized_residual: _Optional[float] = ..., missing: _Optional[bool] = ..., dropped: _Optional[int] = ..., visible: _Optional[int] = ..., occluded: _Optional[int] = ..., rim_visible: _Optional[int] = ..., rim_outside: _Optional[int] = ..., rim_inside: _Optional[int] = ..., rim_occluded: _Optional[int] = ..., agreeing_share: _Optional[float] = ..., disagreeing_share: _Optional[float] = ..., no_return_share: _Optional[float] = ..., occluder_share: _Optional[float] = ..., self_occluded_share: _Optional[float] = ..., outside_share: _Optional[float] = ..., unexplained_share: _Optional[float] = ..., unexplained_at_first: _Optional[float] = ...) -> None: ...
    class DerivedEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: _sensor_model_pb2.NumberList
        def __init__(self, key: _Optional[str] = ..., value: _Optional[_Union[_sensor_model_pb2.NumberList, _Mapping]] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TRACKER_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    MODEL_ID_FIELD_NUMBER: _ClassVar[int]
    CALIB_ID_FIELD_NUMBER: _ClassVar[int]
    THETA_FIELD_NUMBER: _ClassVar[int]
    LOG_LIKELIHOOD_FIELD_NUMBER: _ClassVar[int]
    SEARCH_DEVIATION_FIELD_NUMBER: _ClassVar[int]
    GENERATIONS_FIELD_NUMBER: _ClassVar[int]
    EVALUATIONS_FIELD_NUMBER: _ClassVar[int]
    SOLVE_MS_FIELD_NUMBER: _ClassVar[int]
    AGE_MS_FIELD_NUMBER: _ClassVar[int]
    SKIPPED_FIELD_NUMBER: _ClassVar[int]
    MESH_VERSION_FIELD_NUMBER: _ClassVar[int]
    SENSORS_FIELD_NUMBER: _ClassVar[int]
    INLIER_SHARE_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_VALID_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    CLOCK_SIGMA_NS_FIELD_NUMBER: _ClassVar[int]
    SEARCHER_FIELD_NUMBER: _ClassVar[int]
    STOP_FIELD_NUMBER: _ClassVar[int]
    BUDGET_EVALUATIONS_FIELD_NUMBER: _ClassVar[int]
    BUDGET_MS_FIELD_NUMBER: _ClassVar[int]
    STRETCH_FIELD_NUMBER: _ClassVar[int]
    FOLDED_SHARE_FIELD_NUMBER: _ClassVar[int]
    DEVIATION_M_FIELD_NUMBER: _ClassVar[int]
    WARNINGS_FIELD_NUMBER: _ClassVar[int]
    DERIVED_FIELD_NUMBER: _ClassVar[int]
    AGE_ERROR_MS_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    tracker: str
    status: DeformationState.Status
    reasons: _containers.RepeatedScalarFieldContainer[str]
    model: str
    model_id: str
    calib_id: str
    theta: _containers.RepeatedScalarFieldContainer[float]
    log_likelihood: float
    search_deviation: float
    generations: int
    evaluations: int
    solve_ms: float
    age_ms: float
    skipped: int
    mesh_version: int
    sensors: _containers.RepeatedCompositeFieldContainer[DeformationState.Sensor]
    inlier_share: float
    covariance: _containers.RepeatedScalarFieldContainer[float]
    covariance_valid: bool
    samples: int
    clock_sigma_ns: int
    searcher: str
    stop: DeformationState.Stop
    budget_evaluations: int
    budget_ms: float
    stretch: float
    folded_share: float
    deviation_m: float
    warnings: _containers.RepeatedScalarFieldContainer[str]
    derived: _containers.MessageMap[str, _sensor_model_pb2.NumberList]
    age_error_ms: float
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., tracker: _Optional[str] = ..., status: _Optional[_Union[DeformationState.Status, str]] = ..., reasons: _Optional[_Iterable[str]] = ..., model: _Optional[str] = ..., model_id: _Optional[str] = ..., calib_id: _Optional[str] = ..., theta: _Optional[_Iterable[float]] = ..., log_likelihood: _Optional[float] = ..., search_deviation: _Optional[float] = ..., generations: _Optional[int] = ..., evaluations: _Optional[int] = ..., solve_ms: _Optional[float] = ..., age_ms: _Optional[float] = ..., skipped: _Optional[int] = ..., mesh_version: _Optional[int] = ..., sensors: _Optional[_Iterable[_Union[DeformationState.Sensor, _Mapping]]] = ..., inlier_share: _Optional[float] = ..., covariance: _Optional[_Iterable[float]] = ..., covariance_valid: _Optional[bool] = ..., samples: _Optional[int] = ..., clock_sigma_ns: _Optional[int] = ..., searcher: _Optional[str] = ..., stop: _Optional[_Union[DeformationState.Stop, str]] = ..., budget_evaluations: _Optional[int] = ..., budget_ms: _Optional[float] = ..., stretch: _Optional[float] = ..., folded_share: _Optional[float] = ..., deviation_m: _Optional[float] = ..., warnings: _Optional[_Iterable[str]] = ..., derived: _Optional[_Mapping[str, _sensor_model_pb2.NumberList]] = ..., age_error_ms: _Optional[float] = ...) -> None: ...

class CompactState(_message.Message):
    __slots__ = ("header", "tracker", "status", "mesh_version", "theta_f32", "deviation_m", "age_ms", "offset_f32", "reasons")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TRACKER_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    MESH_VERSION_FIELD_NUMBER: _ClassVar[int]
    THETA_F32_FIELD_NUMBER: _ClassVar[int]
    DEVIATION_M_FIELD_NUMBER: _ClassVar[int]
    AGE_MS_FIELD_NUMBER: _ClassVar[int]
    OFFSET_F32_FIELD_NUMBER: _ClassVar[int]
    REASONS_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    tracker: str
    status: DeformationState.Status
    mesh_version: int
    theta_f32: bytes
    deviation_m: float
    age_ms: float
    offset_f32: bytes
    reasons: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., tracker: _Optional[str] = ..., status: _Optional[_Union[DeformationState.Status, str]] = ..., mesh_version: _Optional[int] = ..., theta_f32: _Optional[bytes] = ..., deviation_m: _Optional[float] = ..., age_ms: _Optional[float] = ..., offset_f32: _Optional[bytes] = ..., reasons: _Optional[_Iterable[str]] = ...) -> None: ...
