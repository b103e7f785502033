"""The claims of the paper, one by one, in the order in which it makes them."""

from __future__ import annotations

from studies.paper import further_checks, loop_checks, model_checks
from studies.paper.claims_of_sweeps import ROVER, SWEEPS
from studies.paper.ledger import Claim, ClaimClass, undecided

CLAIMS = (
    Claim(
        "planar forces leave the pressure",
        "2",
        "With all forces, points and motions in the ground plane “the distribution of its contact force on the ground "
        "becomes statically invariant with respect to the towing motion.”",
        "On the lemniscate tow force (in parts of the weight) and heading are within 1e-6 of each other with the "
        "pressure computed once and with the pressure solved anew at every instant together with the friction.",
        further_checks.pressure_stays,
        kind=ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "contact converges",
        "2.1, Fig. 2",
        "Where the part in traction is excluded “until convergence of the residuals”, a reduced contact patch is left.",
        "Forces and moments of the cells balance the load to 1e-9 of it, no cell pulls, the patch left is below 90 % "
        "of the footprint, its area within 2 % and its pressure within 1 % of the greatest of those of exact clipping.",
        model_checks.contact_converges,
        "The paper makes a new mesh of what is left at each pass; ours keeps one mesh and drops whole cells of it, "
        "which is what the area differs by.",
    ),
    Claim(
        "continuity of the friction law",
        "2.1",
        "“Continuity and differentiability of the friction function are very important for simulation stability”.",
        "For 0.2 s from rest behind the hinge, three solvers of SciPy (explicit, implicit, both) get through with a "
        "continuous law that has a kink; where it jumps to the same plateau none does in 10,000 evaluations.",
        further_checks.continuity_counts,
        "Solvers made for jumps, as time stepping with complementarity, are not tried.",
    ),
    Claim(
        "differentiability of the friction law",
        "2.1",
        "The same, of a law that is continuous but has a kink.",
        "All three solvers take twice the evaluations with the kink or more, or do not get through.",
        further_checks.differentiability_counts,
        "The law with a kink rises as the smooth one does at rest, and ends at the plateau.",
    ),
    Claim(
        "law meets its four numbers",
        "2.1",
        "From μ_s, μ_k, v_s and v_k an annealing algorithm computes the γ of the friction model.",
        "The law peaks within 1 % of μ_s and of v_s, ends within 1 % of μ_k, and at v_k 1 % of the rise is left.",
        further_checks.law_meets_numbers,
        "Whether annealing finds such γ is not tried: ours are found by Newton's method from fixed starts.",
        ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "friction by direction",
        "2.2",
        "The mesh “can, in turn, account for anisotropic friction”.",
        "With friction across the body 1.1 times that along it, the sums over the cells have that ratio within 1e-3.",
        further_checks.friction_by_direction,
        "The paper gives no law for the direction; this one is ours.",
        ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "limits make the rover deviate",
        "2.4",
        "“the constraints of the kinematics of the rover inevitably cause the real trajectory to deviate from the "
        "nominal one.”",
        "With the settings of Fig. 5 the rover arrives with its steering limits and with wheels that steer by a "
        "quarter turn to either side, and its RMS is twice as large with the limits.",
        further_checks.limits_matter,
        ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "smaller areas of feasible centres",
        "2.4.2",
        "“Indeed, the full S_Ωr is made up of other smaller areas—e.g., under the belly of the rover”.",
        "Beside two flanks there are areas, all below a tenth of a flank within 6 m, and one of them is under the "
        "rover.",
        further_checks.smaller_areas,
        "How the paper's one range is mirrored over the four wheels is assumed so that these areas are there.",
        ClaimClass.TUNED,
    ),
    Claim(
        "centre moves within an area",
        "2.4.2",
        "“the ICR can move continuously within each of these areas”.",
        "1000 straight ways between two feasible centres of one flank are feasible throughout.",
        further_checks.centre_moves_within,
        "Every area is an intersection of half-planes.",
        ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "look-ahead pre-empts turns",
        "2.4.4",
        "The look-ahead increases the turning ability “by allowing it to pre-empt otherwise unfeasible turns.”",
        "On both curves of Fig. 8 the share of the steps in case A is larger with a look-ahead of 300 to 400 steps "
        "than without, by 5 points of 100 or more.",
        loop_checks.look_ahead_helps,
        ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "four-wheel control misaligns",
        "2.4.5",
        "“A four-wheel PD steering controller would cause steering misalignments”.",
        "Halfway from straight ahead to the tightest turn a wheel under its own control is more than 10 mrad from the "
        "motion that suits all four best, with the bicycle's control less than 1e-9 rad.",
        further_checks.four_wheels_misalign,
    ),
    Claim(
        "settings of Fig. 5 stress the method",
        "3.1, Fig. 5",
        "“this specific choice of path and planning parameters greatly stresses the accuracy of the methodology”.",
        "The object's RMS is twice as large as with the best threshold and the look-ahead of Fig. 7 or more.",
        loop_checks.stresses,
        "The look-ahead of Fig. 5 is assumed, and short so that it does. " + ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "centre of mass matters",
        "3.1, Fig. 4",
        "“It is apparent that a nonbarycentric application point influences the path the rover takes”.",
        "Over the last quarter, when the start has faded, the rover's paths for G1, G2 and G3 differ by more than 1 cm "
        "on each curve that turns.",
        model_checks.centre_matters,
        "The start, as the bare footprint would settle, is assumed, and the greatest distances are there. On the line "
        "they fade, for the tracked point is the anchor; on the curves the load keeps the paths apart.",
    ),
    Claim(
        "no rule for the centre of mass",
        "3.1, Fig. 4",
        "“it seems that no clear indication of the path of the rover can be easily inferred simply from the location "
        "of G.”",
        "None: the statement names no quantity.",
        undecided("the paper says neither what would be an indication nor how clear it would have to be"),
        takes="A quantity that the paper means by an indication.",
    ),
    Claim(
        "planner stays in case A",
        "3.1, Fig. 5",
        "“the planner stays in case A for the majority of the time” and “transitions between cases A, B, and C several "
        "times”.",
        "More than half of the steps are A, B and C occur, and the case changes three times or more.",
        loop_checks.mostly_case_a,
        "The distance up to which a centre counts as close was set with the three cases of Fig. 5 in view, wheelbase "
        "and track with the outcome of Figs. 5 and 7; the look-ahead is assumed, short so that the planner is "
        "stressed.",
        ClaimClass.TUNED,
        "The authors' distance, wheelbase, track and look-ahead.",
    ),
    Claim(
        "detours are where it is tight",
        "3.1, Fig. 5",
        "The planner is “switching in case B or C in the most challenging segments of the path.”",
        "In the tenth of the steps where the rover's nominal path is tightest more than half are B or C.",
        loop_checks.detours_where_tight,
        "The settings are those of the row above.",
        ClaimClass.TUNED,
        "What the authors call challenging.",
    ),
    *(
        Claim(
            f"case {letter} shows in the object's path",
            "3.1, Fig. 5",
            "Cases B and C “are reflected in Fig. 5(b), which illustrates the real trajectory of the towed object”.",
            f"A tether's length of travel later the object's mean distance from its nominal path is above 1 mm and 1.5 "
            f"times as large for case {letter} as for case A.",
            loop_checks.case_in_object(letter),
            note,
            ClaimClass.TUNED,
            "The authors' settings, and what they count as reflected.",
        )
        for letter, note in (
            (
                "B",
                "The object passes a place a tether's length after the rover: at equal times what case B does shows "
                "while the rover is in case A again.",
            ),
            ("C", ""),
        )
    ),
    Claim(
        "case A reaches its point",
        "2.4.3",
        "“case A guarantees that the vehicle reaches point P_r(t_1) exactly”.",
        "The arc, driven on, passes the point within 0.02 mm in half of the steps in case A and within 0.25 mm in 95 "
        "%.",
        loop_checks.case_a_exact,
        "Exact is the centre that the planner desires. The steering follows it under PD control, within a second or "
        "two: the greatest misses are in the first steps after a stretch in case C. " + ROVER,
        ClaimClass.TUNED,
    ),
    *(
        Claim(
            f"realigns after case {letter}",
            "2.4.3",
            statement,
            f"After each stretch {which} the rover's distance from its path falls to a tenth in case A, and it arrives "
            "in case A.",
            loop_checks.realigns(letter),
            note + ROVER,
            ClaimClass.TUNED,
        )
        for letter, statement, which, note in (
            (
                "B",
                "“if Ω_r* is sufficiently close to Ω_r, the vehicle is able to realign after a certain number of "
                "time-steps Δt.”",
                "in case B alone",
                "",
            ),
            (
                "C",
                "The same, where the centre used is not close.",
                "with case C in it",
                "The paper promises it for B. ",
            ),
        )
    ),
    Claim(
        "deviation vanishes with the time step",
        "2.4.3",
        "The effective trajectory “for sufficiently small Δt deviates negligibly from the nominal one”: read as a "
        "limit.",
        "On both curves the rover's RMS falls at least by half from the largest to the smallest time step, by sixteen.",
        loop_checks.deviation_vanishes,
        "What is left is the threshold's: the rover aims at a point d_t ahead and cuts corners, at any time step. "
        + ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "deviation is small at small time steps",
        "2.4.3",
        "The effective trajectory “for sufficiently small Δt deviates negligibly from the nominal one”: read as an "
        "amount.",
        "On both curves the rover arrives with the smallest time step, its RMS below 1 % of the curve's width.",
        loop_checks.deviation_small,
        "It is as small at large time steps. " + ROVER,
        ClaimClass.TUNED,
        "What the paper calls negligible.",
    ),
    Claim(
        "mesh sets the computing time",
        "3.2, Table 1",
        "“the influence of the mesh on the computation time is noticeable”.",
        "The time grows with the number of cells, to more than twice from the coarsest to the finest.",
        model_checks.mesh_costs,
        kind=ClaimClass.CONSTRUCTION,
    ),
    Claim(
        "seconds of Table 1",
        "3.2, Table 1",
        "Meshes of 132,900 to 1,322 cells take 47.556 to 4.4749 s.",
        "None: the paper's machine and the number of steps timed are not stated.",
        model_checks.mesh_table,
        "Our longest side is 2.8 element sizes, set so that the numbers of cells match. "
        "Ours are 60,000 solves of the moment balance, with the mesh summed in compiled code: linear in the cells. The "
        "time without a mesh is that of few solves, between which the steps are interpolated. The paper's seconds grow "
        "much slower than its cells. 47.6 s over 60,000 steps and 132,900 cells are 6 ns a cell, too little for the "
        "three tanh of its own law: one core can hardly have summed the finest mesh at every step. The paper's column "
        "is nearly a constant 3.4 s and 0.33 ms a cell.",
        takes="The machine and the number of steps timed.",
    ),
    *SWEEPS,
    Claim(
        "towing along a path works",
        "5",
        "“this kind of modeling can be exploited successfully to perform path-planning for the towed object”.",
        "On every curve a threshold exists with which the rover arrives and the object's RMS is below 1 cm.",
        loop_checks.followed,
        ROVER,
        ClaimClass.TUNED,
    ),
    Claim(
        "friction coefficient",
        "4",
        "“the friction coefficient between the object contact surface and the pavement has been estimated” as 0.34 "
        "to 0.36.",
        "None on our numbers.",
        undecided("a measurement of the authors' objects; it is an input here"),
        takes="The authors' measured forces.",
    ),
    Claim(
        "experiments agree with simulation",
        "4, Fig. 10",
        "“a remarkable adherence can be seen between the numerical simulation and the experiments.”",
        "None on these tables.",
        undecided(
            "the authors' footage is not at hand, they give their data on reasonable request; "
            "results/<campaign>/summary.csv has the verdict for any footage"
        ),
        takes="The footage, with the inputs and their deviations.",
    ),
    Claim(
        "what the deviations come from",
        "4",
        "“Comparatively small deviations […] are likely due to discontinuities in the ground, and the elasticity of "
        "the simulated cable.”",
        "None on these tables.",
        undecided("the authors' footage is not at hand, they give their data on reasonable request"),
        takes="The footage; the report's section on what would explain the error then weighs the causes.",
    ),
    Claim(
        "adherence validates",
        "5 and abstract",
        "“the remarkable adherence shown with the model validates the overall approach.”",
        "None: the paper names no tolerance and no deviation of its measurements.",
        undecided("by how much the curves differ and how well they are measured is not stated"),
        takes="The footage, a tolerance set beforehand, and the deviations of the inputs.",
    ),
    *(
        Claim(f"future work: {name}", "5", statement, "None: a plan, not a finding.", undecided(found))
        for name, statement, found in (
            (
                "tether",
                "“a catenary-based model or a continuous flexible element” is to replace the cable's model.",
                "the package has the elastic catenary (`tether.mass_kg_per_m`; tests/physics/test_hanging.py), no "
                "element that bends or swings",
            ),
            (
                "height of the tow point",
                "“the towing point will implement a nonnull vertical offset.”",
                "the package has heights of anchor, hinge and centre of mass (tests/physics/test_spatial.py)",
            ),
            (
                "soft soil",
                "“the possibility of towing an object on soft and granular soil will be investigated”.",
                "the package has a rigid floor alone, with regions of other friction",
            ),
        )
    ),
)
"""All claims, in the order of the paper but for those of single sentences of section 2, which stand together."""
