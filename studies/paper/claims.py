"""The claims of the paper, one by one, in the order in which it makes them."""

from __future__ import annotations

from studies.paper import loop_checks, model_checks
from studies.paper.ledger import Claim, ClaimClass, undecided

STRETCH = (
    "The paper does not say whether its rover path contains the stretch |T|/κ of the tether. With the hinge at the "
    "rest length the object trails by that stretch at any speed, which gives the paper's flat curve and its dependence "
    "on κ; with the hinge where the stretched tether ends, the formula of the model, that lag is gone and only inertia "
    "is left."
)

CLAIMS = (
    Claim(
        "contact converges",
        "2.1, Fig. 2",
        "Excluding the part in traction again and again, the residual converges and a reduced contact patch is left.",
        "Forces and moments of the cells balance the load to 1e-9 of it, no cell pulls, and the patch left is below "
        "90 % of the footprint and within 5 % of it that of exact clipping.",
        model_checks.contact_converges,
    ),
    Claim(
        "centre of mass matters",
        "3.1, Fig. 4",
        "A nonbarycentric place of gravity influences the path that the rover takes.",
        "Over the last quarter, when the start has faded, the rover's paths for G1, G2 and G3 differ by more than 1 cm "
        "on each curve that turns.",
        model_checks.centre_matters,
        "The start, as the bare footprint would settle, is assumed, and the greatest distances are there. On the line "
        "they fade, for the tracked point is the anchor; on the curves the load keeps the paths apart.",
    ),
    Claim(
        "no rule for the centre of mass",
        "3.1, Fig. 4",
        "No clear indication of the path of the rover can be inferred from the location of G.",
        "None: the statement names no quantity.",
        undecided("the paper says neither what would be an indication nor how clear it would have to be"),
        takes="A quantity that the paper means by an indication.",
    ),
    Claim(
        "planner stays in case A",
        "3.1, Fig. 5",
        "The planner stays in case A most of the time and changes to B or C in the most challenging segments.",
        "More than half of the steps are A, B and C occur, and the case changes three times or more.",
        loop_checks.mostly_case_a,
        "The distance up to which a centre counts as close, wheelbase and look-ahead are assumed, the first with the "
        "three cases of Fig. 5 in view.",
        ClaimClass.TUNED,
        "The authors' distance, wheelbase and look-ahead.",
    ),
    *(
        Claim(
            f"case {letter} shows in the object's path",
            "3.1, Fig. 5",
            "Cases B and C of the rover are reflected in the real trajectory of the object.",
            f"The object's mean distance from its nominal path is above 1 mm and 1.5 times as large in case {letter} "
            "as in case A.",
            loop_checks.case_in_object(letter),
            "The object follows with a delay of a tether's length: what case B does shows while the rover is in case A "
            "again.",
            ClaimClass.TUNED,
            "The authors' settings, and what they count as reflected.",
        )
        for letter in "BC"
    ),
    Claim(
        "case A reaches its point",
        "2.4.3",
        "Case A guarantees that the vehicle reaches the point aimed at exactly.",
        "In 95 % of the steps in case A the arc, driven on, passes the point within 1 mm.",
        loop_checks.case_a_exact,
        "What is left is the steering's, which follows the centre of rotation under PD control.",
    ),
    Claim(
        "realigns after B and C",
        "2.4.3",
        "If the centre used is close to the one desired, the vehicle is able to realign after a number of steps.",
        "After each stretch in case B or C the rover's distance from its path falls to a tenth in case A.",
        loop_checks.realigns,
    ),
    Claim(
        "deviation vanishes with the time step",
        "2.4.3",
        "For sufficiently small Δt the effective trajectory deviates negligibly from the nominal one.",
        "On both curves the rover's RMS falls at least by half from the largest to the smallest time step.",
        loop_checks.small_steps,
        "What is left is the threshold's: the rover aims at a point d_t ahead and cuts corners, at any time step.",
        takes="What the paper calls negligible: our deviation is below 1 % of the curves' sizes at any time step.",
    ),
    Claim(
        "mesh sets the computing time",
        "3.2, Table 1",
        "The influence of the mesh on the computation time of the quasi-static model is noticeable.",
        "The time grows with the number of cells, to more than twice from the coarsest to the finest.",
        model_checks.mesh_costs,
        kind=ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "seconds of Table 1",
        "3.2, Table 1",
        "132,900 to 1,322 cells take 47.6 to 4.5 s.",
        "None: the paper's machine and the number of steps timed are not stated.",
        model_checks.mesh_table,
        "Ours are 60,000 solves of the moment balance, with the mesh summed in compiled code: linear in the cells. The "
        "time without a mesh is that of few solves, between which the steps are interpolated. The paper's seconds grow "
        "much slower than its cells. 47.6 s over 60,000 steps and 132,900 cells are 6 ns a cell, too little for the "
        "three tanh of its own law: one core can hardly have summed the finest mesh at every step. The paper's column "
        "is nearly a constant 3.4 s and 0.33 ms a cell.",
        takes="The machine and the number of steps timed.",
    ),
    Claim(
        "feedforward falls with speed",
        "3.2, Fig. 6(a)",
        "The RMS of feedforward dynamics decreases substantially with smaller mean speeds.",
        "It falls with the speed throughout, faster than its square root.",
        model_checks.feedforward_falls,
    ),
    Claim(
        "feedback flat, hinge at rest length",
        "3.2, Fig. 6(a)",
        "The RMS of feedback dynamics is low and roughly constant, and increases only above 5e-2 m/s.",
        "Below 5e-2 m/s it depends on the speed with a power under 0.3 in size, above with a power over 1.",
        model_checks.feedback_flat("feedback_at_rest_length_rms_m"),
        STRETCH,
        ClaimClass.TUNED,
        "Whether the paper's rover path contains the stretch, its κ and its integrator's tolerances.",
    ),
    Claim(
        "feedback flat, hinge at stretched length",
        "3.2, Fig. 6(a)",
        "The RMS of feedback dynamics is low and roughly constant, and increases only above 5e-2 m/s.",
        "As above.",
        model_checks.feedback_flat("feedback_rms_m"),
        STRETCH,
        takes="As above.",
    ),
    Claim(
        "time step does not matter",
        "3.2, Fig. 6(b)",
        "At 5.1e-3 m/s no substantial variation of the RMS occurs with the time step.",
        "All RMS stay within 5 % over the time steps.",
        model_checks.time_step_free,
    ),
    Claim(
        "an order of magnitude, hinge at rest length",
        "3.2, Fig. 6(b)",
        "Feedforward and feedback differ by an order of magnitude at 5.1e-3 m/s.",
        "Their ratio, rounded to a power of ten, is 10.",
        model_checks.order_of_magnitude("feedback_at_rest_length_rms_m"),
        STRETCH + " The ratio is that of our assumed stiffness.",
        ClaimClass.TUNED,
        "The authors' κ.",
    ),
    Claim(
        "an order of magnitude, hinge at stretched length",
        "3.2, Fig. 6(b)",
        "Feedforward and feedback differ by an order of magnitude at 5.1e-3 m/s.",
        "Their ratio, rounded to a power of ten, is 10.",
        model_checks.order_of_magnitude("feedback_rms_m"),
        STRETCH,
        takes="The authors' κ.",
    ),
    Claim(
        "stiffer is closer, hinge at rest length",
        "3.2, Fig. 6(c)",
        "Larger κ leads to smaller RMS.",
        "The RMS falls with the stiffness with a power below -0.5.",
        model_checks.stiffer_is_closer("feedback_at_rest_length_rms_m"),
        STRETCH,
        ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "stiffer is closer, hinge at stretched length",
        "3.2, Fig. 6(c)",
        "Larger κ leads to smaller RMS.",
        "The RMS falls with the stiffness with a power below -0.5.",
        model_checks.stiffer_is_closer("feedback_rms_m"),
        STRETCH,
    ),
    Claim(
        "stiffer is slower",
        "3.2, Fig. 6(c)",
        "Larger κ leads to higher computational time: the model is numerically stiff.",
        "From 1e3 N/m on the integrator's steps grow with the stiffness, and the time by a fifth or more.",
        model_checks.stiffer_is_slower,
        "An implicit method with an exact Jacobian takes the stiffness with few more steps; the paper used ode15s.",
    ),
    Claim(
        "feedforward drift grows",
        "3.2, Fig. 6(d), (e)",
        "Feedforward trajectories drift more as the speed increases.",
        "On both curves the object's end is a fifth or more farther from the nominal end from each speed to the next.",
        model_checks.drift_grows,
    ),
    Claim(
        "feedforward fails from rest, friction with a peak",
        "3.2",
        "Feedforward is unstable when it starts from rest; with the nominal initial velocity it is not.",
        "From rest the RMS is more than ten times that with the nominal velocity.",
        model_checks.start("peaked_friction"),
        "At rest the force of the quasi-static model, the kinetic friction, is less than the static peak: the object "
        "stays, and then goes where the force points later.",
        ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "feedforward fails from rest, friction without a peak",
        "3.2",
        "Feedforward is unstable when it starts from rest; with the nominal initial velocity it is not.",
        "From rest the RMS is more than ten times that with the nominal velocity.",
        model_checks.start("friction"),
        "Without a static peak nothing holds the object back: the failure is the peak's, not that of the start.",
    ),
    Claim(
        "best thresholds",
        "3.2, Fig. 7",
        "For most cases thresholds d_t between 0.1 m and 0.4 m give the best results.",
        "On three curves or more the best of all thresholds lies within 0.1 to 0.4 m.",
        loop_checks.best_thresholds,
        "Below 0.1 m thresholds are as good or a little better here; the paper's wheelbase, which decides how small a "
        "threshold the rover can take, is not given.",
        takes="The authors' rover: wheelbase, track, steering rates.",
    ),
    Claim(
        "lemniscate is erratic",
        "3.2, Fig. 7",
        "The lemniscate shows a more unpredictable behaviour than the other curves.",
        "More thresholds fail on it, and more often next to one that arrives, than on any other curve.",
        loop_checks.lemniscate_erratic,
        "The wheelbase was set with this figure in view.",
        ClaimClass.TUNED,
    ),
    Claim(
        "single thresholds break the controller",
        "3.2, Fig. 7",
        "d_t = 0.227 m and 0.103 m break the controller on the lemniscate.",
        "The rover does not arrive with these two values.",
        loop_checks.breaking_values,
        "Which values break it depends on wheelbase, track, footprint, load and speed, none of which the paper gives. "
        "The way in which it breaks is the paper's: the tip is chosen on the side of the desired centre, which the "
        "planned change of heading decides, and not on the side of the point aimed at.",
        takes="The authors' wheelbase, track and speed.",
    ),
    Claim(
        "feasible areas",
        "3.2, Fig. 8",
        "The feasible area of the lemniscate is smaller and more jagged than that of the rounded square.",
        "Fewer points arrive, and their border is longer for the root of the area.",
        loop_checks.surface_compared,
    ),
    Claim(
        "errors of the surfaces",
        "3.2, Fig. 8",
        "The RMS values of the lemniscate are in general higher.",
        "They are higher at more than half of the points where both curves arrive.",
        loop_checks.surface_errors,
        "Over all points that arrive the square's median is higher, for it arrives at large thresholds where the "
        "lemniscate does not.",
    ),
    Claim(
        "feasible look-aheads",
        "3.2, Fig. 8",
        "ϑ_lh of 300 to 400 steps and d_t from 0 to 1.5 m give feasible results.",
        "On both curves more than half of these points arrive, and more than with other look-aheads.",
        loop_checks.surface_band,
        "The length of the paper's step is not given; ours is 0.1 s of the 600 s that each curve takes.",
    ),
    Claim(
        "orientation must be planned",
        "3.2",
        "Both the planning of the positional path and of the orientation are required for a successful path-following.",
        "On both curves fewer points arrive without a look-ahead than with one of 300 to 400 steps, or their median "
        "RMS is 1.5 times as large.",
        loop_checks.orientation_needed,
        "Without a look-ahead the heading planned for a point is that of the path there, which is a plan as well; what "
        "the look-ahead adds is the average over the turn ahead.",
    ),
    Claim(
        "towing along a path works",
        "5",
        "The approach can be used successfully for path planning of the towed object.",
        "On every curve a threshold exists with which the rover arrives and the object's RMS is below 1 cm.",
        loop_checks.followed,
    ),
    Claim(
        "friction coefficient",
        "4",
        "μ between object and pavement is 0.34 to 0.36.",
        "None on our numbers.",
        undecided("a measurement of the authors' objects; it is an input here"),
        takes="The authors' measured forces.",
    ),
    Claim(
        "experiments agree with simulation",
        "4, Fig. 10",
        "Simulated and measured object paths adhere remarkably in four runs.",
        "None on these tables.",
        undecided(
            "the authors' footage is not public; results/<campaign>/summary.csv has the verdict for any footage at hand"
        ),
        takes="The footage, with the inputs and their deviations.",
    ),
    Claim(
        "what the deviations come from",
        "4",
        "Small deviations are likely due to discontinuities in the ground and the elasticity of the simulated cable.",
        "None on these tables.",
        undecided(
            "the authors' footage is not public, and other causes, such as the height of the tow point, are larger"
        ),
        takes="The footage; the report's section on what would explain the error then weighs the causes.",
    ),
)
"""All claims, in the order of the paper."""
