"""The claims of the paper on its sweeps of speed, stiffness, thresholds and look-aheads: Figs. 6 to 8."""

from __future__ import annotations

from studies.paper import further_checks, loop_checks, model_checks
from studies.paper.ledger import Claim, ClaimClass

STRETCH = (
    "The paper does not say whether its rover path contains the stretch |T|/κ of the tether. With the hinge at the "
    "rest length the object trails by that stretch at any speed, which gives the paper's flat curve and its dependence "
    "on κ; with the hinge where the stretched tether ends, the formula of the model, that lag is gone and only inertia "
    "is left."
)

ROVER = (
    "Stands on the rover's wheelbase and track, which were set with the outcome of Figs. 5 and 7 in view (`plan.yaml`)."
)

SWEEPS = (
    Claim(
        "feedforward falls with speed",
        "3.2, Fig. 6(a)",
        "“the RMS decreases substantially with smaller average velocities in the case of the FFD.”",
        "It falls with the speed throughout, faster than its square root.",
        model_checks.feedforward_falls,
        "Stands on the assumed friction without a peak, μ_s = μ_k: with one the object sticks and slips below v_k.",
    ),
    Claim(
        "feedforward is accurate when slow",
        "3.2",
        "“the method is accurate only for arbitrarily low speeds.”",
        "The RMS of feedforward is below 2 mm, 0.1 % of the curve's width, at the lowest speed and above 2 cm at the "
        "highest.",
        model_checks.accurate_when_slow,
        "Stands on friction without a peak too.",
    ),
    Claim(
        "feedback flat, hinge at rest length",
        "3.2, Fig. 6(a)",
        "For feedback dynamics “the value remains low and roughly constant”; “the value increases only” above 5e-2 "
        "m/s.",
        "Below 5e-2 m/s it depends on the speed with a power under 0.3 in size, above with a power over 1.",
        model_checks.feedback_flat("feedback_at_rest_length_rms_m"),
        STRETCH,
        ClaimClass.TUNED,
        "Whether the paper's rover path contains the stretch, its κ and its integrator's tolerances.",
    ),
    Claim(
        "feedback flat, hinge at stretched length",
        "3.2, Fig. 6(a)",
        "For feedback dynamics “the value remains low and roughly constant”; “the value increases only” above 5e-2 "
        "m/s.",
        "As above.",
        model_checks.feedback_flat("feedback_rms_m"),
        STRETCH,
        takes="As above.",
    ),
    Claim(
        "time step does not matter",
        "3.2, Fig. 6(b)",
        "At 5.1e-3 m/s “no substantial variation occurs in the RMS value” with the time step.",
        "All RMS stay within 5 % over the time steps.",
        model_checks.time_step_free,
    ),
    Claim(
        "an order of magnitude, hinge at rest length",
        "3.2, Fig. 6(b)",
        "Feedforward and feedback differ by “an order of magnitude” at 5.1e-3 m/s.",
        "Their ratio is from 3.2 to 32: to a power of ten it is 10.",
        model_checks.order_of_magnitude("feedback_at_rest_length_rms_m"),
        STRETCH + " The ratio is that of our assumed stiffness.",
        ClaimClass.TUNED,
        "The authors' κ.",
    ),
    Claim(
        "an order of magnitude, hinge at stretched length",
        "3.2, Fig. 6(b)",
        "Feedforward and feedback differ by “an order of magnitude” at 5.1e-3 m/s.",
        "Their ratio is from 3.2 to 32: to a power of ten it is 10.",
        model_checks.order_of_magnitude("feedback_rms_m"),
        STRETCH,
        takes="The authors' κ.",
    ),
    Claim(
        "stiffer is closer, hinge at rest length",
        "3.2, Fig. 6(c)",
        "“larger values leading to smaller RMS”.",
        "The RMS falls with the stiffness with a power below -0.5.",
        model_checks.stiffer_is_closer("feedback_at_rest_length_rms_m"),
        STRETCH,
        ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "stiffer is closer, hinge at stretched length",
        "3.2, Fig. 6(c)",
        "“larger values leading to smaller RMS”.",
        "The RMS falls with the stiffness with a power below -0.5.",
        model_checks.stiffer_is_closer("feedback_rms_m"),
        STRETCH,
    ),
    *(
        Claim(
            f"stiffer is slower, hinge at {place} length",
            "3.2, Fig. 6(c)",
            "Larger κ leads to “higher computational time. This indicates that a certain numerical stiffness exists in "
            "the model.”",
            "The greatest stiffness takes more of the integrator's steps than any other, and a fifth or more above the "
            "time of the least.",
            model_checks.stiffer_is_slower(name),
            note,
        )
        for place, name, note in (
            (
                "rest",
                "feedback_at_rest_length",
                "Not at every stiffness: the tether starts unstretched, and the object swings until the stretch is "
                "there; the steps grow from 1e4 N/m on alone.",
            ),
            (
                "stretched",
                "feedback",
                "Not at every stiffness: the steps grow from 316 N/m on; the softest tether, which stretches by "
                "0.17 m, takes more than that.",
            ),
        )
    ),
    Claim(
        "feedforward drift grows",
        "3.2, Fig. 6(d), (e)",
        "“the dynamic curves exhibit larger drift as the speed increases, with respect to the nominal one.”",
        "On both curves the object's end is a fifth or more farther from the nominal end from each speed to the next, "
        "and over 20 mm at the highest.",
        model_checks.drift_grows,
    ),
    Claim(
        "feedforward at reasonable speed",
        "3.2, Fig. 6(d), (e)",
        "“when the velocities take reasonable values, the curves tend to the nominal one.”",
        "On both curves the object ends within 1 % of the curve's width of the nominal end at the lowest speed.",
        model_checks.slow_is_nominal,
        "Stands on friction without a peak too.",
    ),
    Claim(
        "spring corrects",
        "3.2",
        "That feedback seems not to be influenced by velocity “is possibly due to the model used to describe the "
        "system, in which the spring acts as a means to control and correct the position of the object.”",
        "The RMS of feedback stays below 1 mm on a floor with 1 % less friction than planned, at 5.1e-3 m/s.",
        further_checks.spring_corrects,
        "That the spring corrects is decided, not that this is the reason.",
    ),
    Claim(
        "blind forces exacerbate",
        "3.2",
        "“in the FFD case, the forces are fed to the system blindly, which tends to exacerbate deviations.”",
        "The RMS of feedforward is ten times as large on a floor with 1 % less friction than planned, at 5.1e-3 m/s.",
        further_checks.blind_force_exacerbates,
        "A force above the friction accelerates the object without end.",
        ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "feedforward fails from rest, friction with a peak",
        "3.2",
        "Feedforward “tends to be unstable in the starting phase”; the nominal velocity at the start “removes the "
        "problem.”",
        "With the nominal velocity the RMS is below 1 cm; from rest it is more than ten times that, or the motion "
        "ends early.",
        model_checks.start("peaked_friction"),
        "At rest the force of the quasi-static model, the kinetic friction, is less than the static peak: the object "
        "stays, and then goes where the force points later.",
        ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "feedforward fails from rest, friction without a peak",
        "3.2",
        "Feedforward “tends to be unstable in the starting phase”; the nominal velocity at the start “removes the "
        "problem.”",
        "With the nominal velocity the RMS is below 1 cm; from rest it is more than ten times that, or the motion "
        "ends early.",
        model_checks.start("friction"),
        "Without a static peak nothing holds the object back: the failure is the peak's, not that of the start.",
    ),
    Claim(
        "best thresholds",
        "3.2, Fig. 7",
        "“it is clear for most cases how values between 0.1 m and 0.4 m give the best results.”",
        "On three curves or more the best RMS within 0.1 to 0.4 m is at most 1.1 times the best of all thresholds that "
        "arrive.",
        loop_checks.best_thresholds,
        ROVER,
        ClaimClass.TUNED,
        "The authors' rover: wheelbase, track, steering rates.",
    ),
    Claim(
        "thresholds above 0.4 m are worse",
        "3.2, Fig. 7",
        "“it is clear for most cases how values between 0.1 m and 0.4 m give the best results.”",
        "On three curves or more the best RMS above 0.4 m is more than 1.1 times the best within 0.1 to 0.4 m.",
        loop_checks.larger_are_worse,
        ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "thresholds below 0.1 m are worse",
        "3.2, Fig. 7",
        "“it is clear for most cases how values between 0.1 m and 0.4 m give the best results.”",
        "On three curves or more the best RMS below 0.1 m is more than 1.1 times the best within 0.1 to 0.4 m.",
        loop_checks.smaller_are_worse,
        "How small a threshold the rover can take depends on the wheelbase, which the paper does not give. " + ROVER,
        ClaimClass.TUNED,
        "The authors' rover: wheelbase, track, steering rates.",
    ),
    Claim(
        "lemniscate is erratic",
        "3.2, Fig. 7",
        "“the case of the lemniscate curve shows a more unpredictable behavior.”",
        "More single thresholds fail on it between two that arrive than on any other curve.",
        loop_checks.lemniscate_erratic,
        "More thresholds fail on the lemniscate than elsewhere, but in whole ranges: the smallest and the largest. "
        + ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "single thresholds break the controller",
        "3.2, Fig. 7",
        "On the lemniscate “d_t = 0.227 m and 0.103 m completely ‘break’ the controller”: the rover strays “by a very "
        "large margin”.",
        "The rover does not arrive with these two values.",
        loop_checks.breaking_values,
        "Which values break it depends on wheelbase, track, footprint, load and speed, none of which the paper gives. "
        + ROVER,
        ClaimClass.TUNED,
        takes="The authors' wheelbase, track and speed.",
    ),
    Claim(
        "far centres break the controller",
        "3.2, Fig. 7",
        "“the large deviations are due to the fact that the ICR that are determined are very far from optimal”.",
        "On the lemniscate the median share of the steps in case C is twice as large with thresholds that fail as with "
        "those that arrive.",
        loop_checks.far_centres_break,
        "Which is cause and which effect is not decided: a rover that has strayed needs far centres. " + ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "tight turns are the cause",
        "3.2, Fig. 7",
        "“This is likely due to the fact that the controller is unable to adequately operate with such small "
        "curvatures.”",
        "Thresholds fail on the lemniscate, and at most half as many on one twice as wide.",
        further_checks.tight_turns_fail,
        "By small curvatures the paper means small radii. " + ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "feasible areas",
        "3.2, Fig. 8",
        "“The feasible area of the former appears smaller, more jagged” than that of the rounded square.",
        "Fewer points arrive, and their border is longer for the root of the area.",
        loop_checks.surface_compared,
        ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "errors of the surfaces, where both arrive",
        "3.2, Fig. 8",
        "The lemniscate's area is “in general with higher RMS values compared to the latter”.",
        "They are higher at more than half of the points where both curves arrive.",
        loop_checks.surface_errors,
        ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "errors of the surfaces, over all that arrive",
        "3.2, Fig. 8",
        "The lemniscate's area is “in general with higher RMS values compared to the latter”.",
        "The median over all points that arrive is higher.",
        loop_checks.surface_errors_of_all,
        "The square arrives at large thresholds, with large errors, where the lemniscate does not. On a grid of six "
        "by seven the medians lie the other way round (see the control): the outcome depends on the grid. " + ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "feasible look-aheads",
        "3.2, Fig. 8",
        "“In general, ϑ_lh values of around 300 and 400 steps and values of d_t between 0 and 1.5 m seem to give "
        "feasible results.”",
        "On both curves more than half of these points arrive, and more than with other look-aheads by 5 points of 100 "
        "or more.",
        loop_checks.surface_band,
        "The length of the paper's step is not given; ours is 0.1 s of the 600 s that each curve takes. " + ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "orientation must be planned",
        "3.2",
        "“We have hypothesized […] that both the planning of the positional path and of the orientation are required "
        "for a successful path-following.”",
        "On both curves fewer points arrive without a look-ahead than with one of 300 to 400 steps, by 5 points of 100 "
        "or more, or their median RMS is 1.5 times as large.",
        loop_checks.orientation_needed,
        "Without a look-ahead the heading planned for a point is that of the path there, which is a plan as well; what "
        "the look-ahead adds is the average over the turn ahead. " + ROVER,
        ClaimClass.TUNED,
    ),
)
