"""Every check of an input or an answer, in the order in which findings are listed: a new one is one line here."""

from __future__ import annotations

from basecal.accuracy.findings.better_optimum import better_optimum
from basecal.accuracy.findings.board_shape import board_shape
from basecal.accuracy.findings.dropped_samples import many_dropped_samples
from basecal.accuracy.findings.evidence import AnswerCheck, InputCheck
from basecal.accuracy.findings.far_task import far_task
from basecal.accuracy.findings.held_out_places import held_out_places
from basecal.accuracy.findings.identical_robots import identical_robots
from basecal.accuracy.findings.identity_poses import identity_poses
from basecal.accuracy.findings.inconsistent_folds import inconsistent_folds
from basecal.accuracy.findings.joint_parameters import unobserved_joint_parameters
from basecal.accuracy.findings.late_images import late_images
from basecal.accuracy.findings.lens_model import lens_model
from basecal.accuracy.findings.likely_kinematics import likely_kinematics
from basecal.accuracy.findings.long_mount import long_mount
from basecal.accuracy.findings.near_bases import near_bases
from basecal.accuracy.findings.noise_not_identifiable import noise_not_identifiable
from basecal.accuracy.findings.not_converged import not_converged
from basecal.accuracy.findings.not_validated import not_validated
from basecal.accuracy.findings.outlier_points import outlier_points
from basecal.accuracy.findings.outlier_samples import agreeing_samples, far_stops, outlier_samples
from basecal.accuracy.findings.overfit import overfit
from basecal.accuracy.findings.poor_fit import poor_fit
from basecal.accuracy.findings.prior_contradicted import prior_contradicted
from basecal.accuracy.findings.prior_dominated import prior_dominated
from basecal.accuracy.findings.reflection import reflection
from basecal.accuracy.findings.robot_model import robot_model
from basecal.accuracy.findings.rounded_poses import rounded_poses
from basecal.accuracy.findings.same_stop import same_stop
from basecal.accuracy.findings.stated_lens import stated_lens
from basecal.accuracy.findings.systematic_error import systematic_error
from basecal.accuracy.findings.too_few_samples import too_few_samples
from basecal.accuracy.findings.touch_noise import touch_noise
from basecal.accuracy.findings.two_mounts import two_mounts
from basecal.accuracy.findings.unit_length import unit_lengths
from basecal.accuracy.findings.unobservable_direction import unobservable_directions
from basecal.accuracy.findings.weak_direction import weak_directions

INPUT_CHECKS: tuple[InputCheck, ...] = (many_dropped_samples, too_few_samples, identity_poses, same_stop)
INPUT_CHECKS += (identical_robots,)

ANSWER_CHECKS: tuple[AnswerCheck, ...] = (
    rounded_poses,
    systematic_error,
    two_mounts,
    robot_model,
    likely_kinematics,
    poor_fit,
    touch_noise,
    held_out_places,
    better_optimum,
    noise_not_identifiable,
    unobservable_directions,
    weak_directions,
    unit_lengths,
    prior_dominated,
    not_converged,
    outlier_samples,
    late_images,
    outlier_points,
    reflection,
    board_shape,
    lens_model,
    agreeing_samples,
    far_stops,
    prior_contradicted,
    stated_lens,
    unobserved_joint_parameters,
    far_task,
    near_bases,
    long_mount,
    not_validated,
    inconsistent_folds,
    overfit,
)
