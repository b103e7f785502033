"""The claims of the paper, one by one, in the order in which it makes them."""

from __future__ import annotations

from studies.paper import claim_checks as checks
from studies.paper.ledger import Claim, undecided

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
        "The residual ends below 1e-9 of the load and less than 90 % of the footprint stay in contact.",
        checks.contact_converges,
    ),
    Claim(
        "centre of mass matters",
        "3.1, Fig. 4",
        "A nonbarycentric place of gravity influences the path that the rover takes.",
        "The rover's paths for G1, G2 and G3 differ by more than 1 cm on every curve.",
        checks.centre_matters,
        "The start, as the bare footprint would settle, is assumed, and the greatest distances are there. On the line "
        "they fade, for the tracked point is the anchor; on the curves the load keeps the paths apart.",
    ),
    Claim(
        "no rule for the centre of mass",
        "3.1, Fig. 4",
        "No clear indication of the path of the rover can be inferred from the location of G.",
        "None: the statement names no quantity.",
        undecided("the paper says neither what would be an indication nor how clear it would have to be"),
    ),
    Claim(
        "planner stays in case A",
        "3.1, Fig. 5",
        "The planner stays in case A most of the time and changes to B or C in the most challenging segments.",
        "More than half of the steps are A, B and C occur, and the case changes three times or more.",
        checks.mostly_case_a,
    ),
    Claim(
        "cases show in the object's path",
        "3.1, Fig. 5",
        "Cases B and C of the rover are reflected in the real trajectory of the object.",
        "The object is farther from its nominal path in cases B or C than in case A.",
        checks.cases_in_both,
    ),
    Claim(
        "mesh sets the computing time",
        "3.2, Table 1",
        "The influence of the mesh on the computation time of the quasi-static model is noticeable.",
        "The time grows with the number of cells.",
        checks.mesh_costs,
    ),
    Claim(
        "seconds of Table 1",
        "3.2, Table 1",
        "132,900 to 1,322 cells take 47.6 to 4.5 s.",
        "Our mesh with as many cells takes between half and twice as long.",
        checks.mesh_table,
        "Ours are 60,000 solves of the moment balance, with the mesh summed in compiled code: linear in the cells. The "
        "paper's seconds grow much slower than its cells. 47.6 s over 60,000 steps and 132,900 cells are 6 ns a cell, "
        "too little for the three tanh of its own law: one core can hardly have summed the finest mesh at every step. "
        "How many steps were timed is not said.",
    ),
    Claim(
        "quasi-static model is fast",
        "3.1",
        "The quasi-static model can be used to synthesise trajectories (10 min in steps of 10 ms).",
        "60,000 steps of every path take less than a second with the exact wrench.",
        checks.quasistatic_time,
    ),
    Claim(
        "feedforward falls with speed",
        "3.2, Fig. 6(a)",
        "The RMS of feedforward dynamics decreases substantially with smaller mean speeds.",
        "It falls with the speed throughout, faster than its square root.",
        checks.feedforward_falls,
    ),
    Claim(
        "feedback flat, hinge at rest length",
        "3.2, Fig. 6(a)",
        "The RMS of feedback dynamics is low and roughly constant, and increases only above 5e-2 m/s.",
        "Below 5e-2 m/s it depends on the speed with a power under 0.3 in size, above with a power over 1.",
        checks.feedback_flat("feedback_at_rest_length_rms_m"),
        STRETCH,
    ),
    Claim(
        "feedback flat, hinge at stretched length",
        "3.2, Fig. 6(a)",
        "The RMS of feedback dynamics is low and roughly constant, and increases only above 5e-2 m/s.",
        "As above.",
        checks.feedback_flat("feedback_rms_m"),
        STRETCH,
    ),
    Claim(
        "time step does not matter",
        "3.2, Fig. 6(b)",
        "At 5.1e-3 m/s no substantial variation of the RMS occurs with the time step.",
        "All RMS stay within 5 % over the time steps.",
        checks.time_step_free,
    ),
    Claim(
        "an order of magnitude, hinge at rest length",
        "3.2, Fig. 6(b)",
        "Feedforward and feedback differ by an order of magnitude at 5.1e-3 m/s.",
        "Their ratio, rounded to a power of ten, is 10.",
        checks.order_of_magnitude("feedback_at_rest_length_rms_m"),
        STRETCH + " The ratio is that of our assumed stiffness.",
    ),
    Claim(
        "an order of magnitude, hinge at stretched length",
        "3.2, Fig. 6(b)",
        "Feedforward and feedback differ by an order of magnitude at 5.1e-3 m/s.",
        "Their ratio, rounded to a power of ten, is 10.",
        checks.order_of_magnitude("feedback_rms_m"),
        STRETCH,
    ),
    Claim(
        "stiffer is closer, hinge at rest length",
        "3.2, Fig. 6(c)",
        "Larger κ leads to smaller RMS.",
        "The RMS falls with the stiffness with a power below -0.5.",
        checks.stiffer_is_closer("feedback_at_rest_length_rms_m"),
        STRETCH,
    ),
    Claim(
        "stiffer is closer, hinge at stretched length",
        "3.2, Fig. 6(c)",
        "Larger κ leads to smaller RMS.",
        "The RMS falls with the stiffness with a power below -0.5.",
        checks.stiffer_is_closer("feedback_rms_m"),
        STRETCH,
    ),
    Claim(
        "stiffer is slower",
        "3.2, Fig. 6(c)",
        "Larger κ leads to higher computational time: the model is numerically stiff.",
        "From 1e3 N/m on the integrator's steps grow with the stiffness, and the time by a fifth or more.",
        checks.stiffer_is_slower,
        "An implicit method with an exact Jacobian takes the stiffness with few more steps; the paper used ode15s.",
    ),
    Claim(
        "feedforward drift grows",
        "3.2, Fig. 6(d), (e)",
        "Feedforward trajectories drift more as the speed increases.",
        "On both curves the object's end is the farther from the nominal end, the faster it goes.",
        checks.drift_grows,
    ),
    Claim(
        "feedforward fails from rest, friction with a peak",
        "3.2",
        "Feedforward is unstable when it starts from rest; with the nominal initial velocity it is not.",
        "From rest the RMS is more than ten times that with the nominal velocity.",
        checks.start("peaked_friction"),
        "At rest the force of the quasi-static model, the kinetic friction, is less than the static peak: the object "
        "stays, and then goes where the force points later.",
    ),
    Claim(
        "feedforward fails from rest, friction without a peak",
        "3.2",
        "Feedforward is unstable when it starts from rest; with the nominal initial velocity it is not.",
        "From rest the RMS is more than ten times that with the nominal velocity.",
        checks.start("friction"),
        "Without a static peak nothing holds the object back: the failure is the peak's, not that of the start.",
    ),
    Claim(
        "best thresholds",
        "3.2, Fig. 7",
        "For most cases thresholds d_t between 0.1 m and 0.4 m give the best results.",
        "On three curves or more the best RMS within 0.1 to 0.4 m is at most 1.5 times the best of all.",
        checks.best_thresholds,
    ),
    Claim(
        "lemniscate is erratic",
        "3.2, Fig. 7",
        "The lemniscate shows a more unpredictable behaviour than the other curves.",
        "More thresholds fail on it, and more often next to one that arrives, than on any other curve.",
        checks.lemniscate_erratic,
    ),
    Claim(
        "single thresholds break the controller",
        "3.2, Fig. 7",
        "d_t = 0.227 m and 0.103 m break the controller on the lemniscate.",
        "The rover does not arrive with these two values.",
        checks.breaking_values,
        "Which values break it depends on wheelbase, track, footprint, load and speed, none of which the paper gives. "
        "The way in which it breaks is the paper's: the tip is chosen on the side of the desired centre, which the "
        "planned change of heading decides, and not on the side of the point aimed at.",
    ),
    Claim(
        "feasible areas",
        "3.2, Fig. 8",
        "The feasible area of the lemniscate is smaller and more jagged than that of the rounded square.",
        "Fewer points arrive, and their border is longer for the root of the area.",
        checks.surface_compared,
    ),
    Claim(
        "errors of the surfaces",
        "3.2, Fig. 8",
        "The RMS values of the lemniscate are in general higher.",
        "They are higher at more than half of the points where both curves arrive.",
        checks.surface_errors,
        "Over all points that arrive the square's median is higher, for it arrives at large thresholds where the "
        "lemniscate does not.",
    ),
    Claim(
        "feasible look-aheads",
        "3.2, Fig. 8",
        "ϑ_lh of 300 to 400 steps and d_t from 0 to 1.5 m give feasible results.",
        "More than half of these points arrive, on both curves.",
        checks.surface_band,
        "The length of the paper's step is not given; ours is 0.1 s of the 600 s that each curve takes.",
    ),
    Claim(
        "towing along a path works",
        "5",
        "The approach can be used successfully for path planning of the towed object.",
        "On every curve a threshold exists with which the rover arrives and the object's RMS is below 1 cm.",
        checks.followed,
    ),
    Claim(
        "friction coefficient",
        "4",
        "μ between object and pavement is 0.34 to 0.36.",
        "None on our numbers.",
        undecided("a measurement of the authors' objects; it is an input here"),
    ),
    Claim(
        "experiments agree with simulation",
        "4, Fig. 10",
        "Simulated and measured object paths adhere remarkably in four runs.",
        "None on these tables.",
        undecided(
            "the authors' footage is not public; results/<campaign>/summary.csv has the verdict for any footage at hand"
        ),
    ),
)
"""All claims, in the order of the paper."""
