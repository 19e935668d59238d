(* The text of the source (Source.v, written by extract.py) computes the same as Model.v, in every arithmetic.
   The two are compared operation by operation: a changed constant, operation or order fails here. *)
From Coq Require Import List.
From Clearance Require Import Arithmetic Model Source.
Import ListNotations.

Section Tie.
Context {A : arith}.

Lemma vadd_tied : @Source.vadd A = Model.vadd. Proof. reflexivity. Qed.
Lemma vsub_tied : @Source.vsub A = Model.vsub. Proof. reflexivity. Qed.
Lemma vneg_tied : @Source.vneg A = Model.vneg. Proof. reflexivity. Qed.
Lemma vscale_tied : @Source.vscale A = Model.vscale. Proof. reflexivity. Qed.
Lemma dot_tied : @Source.dot A = Model.dot. Proof. reflexivity. Qed.
Lemma squared_norm_tied : forall a, @Source.squared_norm A a = Model.dot a a. Proof. reflexivity. Qed.
Lemma norm_tied : @Source.norm A = Model.norm. Proof. reflexivity. Qed.
Lemma mat_times_tied : @Source.mat_times A = Model.mat_times. Proof. reflexivity. Qed.
Lemma transpose_times_tied : @Source.transpose_times A = Model.transpose_times. Proof. reflexivity. Qed.
Lemma transpose_times_mat_tied : @Source.transpose_times_mat A = Model.transpose_times_mat. Proof. reflexivity. Qed.

Lemma unit_tied : @Source.unit A = Model.unit. Proof. reflexivity. Qed.
Lemma underflow_length_tied : @Source.underflow_length A = Model.underflow_length. Proof. reflexivity. Qed.
Lemma safely_squared_tied : @Source.safely_squared A = Model.safely_squared. Proof. reflexivity. Qed.
Lemma lower_units_tied : @Source.lower_units A = Model.lower_units. Proof. reflexivity. Qed.
Lemma upper_units_tied : @Source.upper_units A = Model.upper_units. Proof. reflexivity. Qed.

Lemma pair_scale_tied : @Source.pair_scale A = Model.pair_scale. Proof. reflexivity. Qed.
Lemma rounding_error_tied : @Source.rounding_error A = Model.rounding_error. Proof. reflexivity. Qed.
Lemma lower_from_gap_tied : @Source.lower_from_gap A = Model.lower_from_gap. Proof. reflexivity. Qed.
Lemma upper_from_point_tied : @Source.upper_from_point A = Model.upper_from_point. Proof. reflexivity. Qed.

Lemma simplex_point_tied : forall size a b c d p q r s,
  @Source.simplex_point A size a b c d p q r s =
  Model.simplex_point (firstn size [a; b; c; d]) (firstn size [p; q; r; s]).
Proof. intros size a b c d p q r s. destruct size as [|[|[|[|[|size]]]]]; reflexivity. Qed.

Lemma frame_R_tied : @Source.frame_R A = Model.frame_R. Proof. reflexivity. Qed.
Lemma frame_D_tied : @Source.frame_D A = Model.frame_D. Proof. reflexivity. Qed.
Lemma cso_vertex_tied : @Source.cso_vertex A = Model.cso_vertex. Proof. reflexivity. Qed.
Lemma support_gap_tied : @Source.support_gap A = Model.support_gap. Proof. reflexivity. Qed.
Lemma lanes_gap_tied : @Source.lanes_gap A = Model.support_gap. Proof. reflexivity. Qed.
Lemma along_a_tied : forall R v, @Source.along_a A R v = Model.vneg v. Proof. reflexivity. Qed.
Lemma along_b_tied : @Source.along_b A = Model.transpose_times. Proof. reflexivity. Qed.
Lemma direction_gap_tied : @Source.direction_gap A = Model.direction_gap. Proof. reflexivity. Qed.
Lemma direction_back_tied : forall R n, @Source.direction_back A R n = Model.vneg (Model.transpose_times R n).
Proof. reflexivity. Qed.
Lemma scan_product_tied : @Source.scan_product A = Model.dot. Proof. reflexivity. Qed.
Lemma run_lower_tied : @Source.run_lower A = Model.run_lower. Proof. reflexivity. Qed.
Lemma run_upper_tied : @Source.run_upper A = Model.run_upper. Proof. reflexivity. Qed.

Lemma placed_R_tied : @Source.placed_R A = Model.frame_R. Proof. reflexivity. Qed.
Lemma placed_D_tied : @Source.placed_D A = Model.frame_D. Proof. reflexivity. Qed.
Lemma placed_radius_tied : @Source.placed_radius A = add. Proof. reflexivity. Qed.
Lemma placed_scale_tied : forall D rho_a rho_b r_a r_b,
  @Source.placed_scale A D rho_a rho_b r_a r_b = Model.pair_scale D rho_a rho_b (add r_a r_b).
Proof. reflexivity. Qed.
Lemma placed_error_tied : @Source.placed_error A = Model.placed_error. Proof. reflexivity. Qed.
Lemma placed_cso_vertex_tied : @Source.placed_cso_vertex A = Model.cso_vertex. Proof. reflexivity. Qed.
Lemma placed_lower_tied : @Source.placed_lower A = Model.lower_from_gap. Proof. reflexivity. Qed.
Lemma placed_upper_tied : forall w radius error,
  @Source.placed_upper A w radius error = Model.upper_from_point (Model.norm w) radius error.
Proof. reflexivity. Qed.
End Tie.
