(* What the source computes, as read by a person: one operation of [arith] for each one of the source.
   Tie.v proves that the source computes the same. *)
From Coq Require Import ZArith Bool List.
From Clearance Require Import Arithmetic.

Record vec (S : Type) := V { x : S; y : S; z : S }.
Arguments V {S}. Arguments x {S}. Arguments y {S}. Arguments z {S}.
Record mat (S : Type) := M { row0 : vec S; row1 : vec S; row2 : vec S }.
Arguments M {S}. Arguments row0 {S}. Arguments row1 {S}. Arguments row2 {S}.

Section Source.
Context {A : arith}.

(* engine/base/vec.h *)
Definition vadd (a b : vec T) : vec T := V (add (x a) (x b)) (add (y a) (y b)) (add (z a) (z b)).
Definition vsub (a b : vec T) : vec T := V (sub (x a) (x b)) (sub (y a) (y b)) (sub (z a) (z b)).
Definition vneg (a : vec T) : vec T := V (neg (x a)) (neg (y a)) (neg (z a)).
Definition vscale (a : vec T) (s : T) : vec T := V (mul (x a) s) (mul (y a) s) (mul (z a) s).
Definition dot (a b : vec T) : T := add (add (mul (x a) (x b)) (mul (y a) (y b))) (mul (z a) (z b)).
Definition norm (a : vec T) : T := root (dot a a).
Definition mat_times (m : mat T) (v : vec T) : vec T := V (dot (row0 m) v) (dot (row1 m) v) (dot (row2 m) v).
Definition transpose (m : mat T) : mat T :=
  M (V (x (row0 m)) (x (row1 m)) (x (row2 m))) (V (y (row0 m)) (y (row1 m)) (y (row2 m)))
    (V (z (row0 m)) (z (row1 m)) (z (row2 m))).
Definition transpose_times (m : mat T) (v : vec T) : vec T := mat_times (transpose m) v.
Definition transpose_times_mat (m b : mat T) : mat T :=
  M (transpose_times b (row0 (transpose m))) (transpose_times b (row1 (transpose m)))
    (transpose_times b (row2 (transpose m))).

(* engine/base/arithmetic.h, engine/narrow/certify.h: constants *)
Definition unit : T := two_to (-53).
Definition underflow_length : T := decimal 1 (-150).
Definition safely_squared : T := decimal 1 (-100).
Definition lower_units : T := whole 30.
Definition upper_units : T := whole 34.

(* engine/narrow/certify.h *)
Definition pair_scale (D : vec T) (rho_a rho_b radius : T) : T :=
  mul (add (add (add (norm D) rho_a) rho_b) radius) (add (whole 1) (mul (whole 32) unit)).
Definition rounding_error (units scale : T) : T :=
  add (mul (mul (mul units unit) scale) (add (whole 1) (mul (whole 16) unit))) underflow_length.
Definition lower_from_gap (gap length radius error : T) : T := sub (sub (div gap length) radius) error.
Definition upper_from_point (length radius error : T) : T := add (sub length radius) error.

(* engine/narrow/pair_run.h: the frame of a *)
Definition frame_R (R_wa R_wb : mat T) : mat T := transpose_times_mat R_wa R_wb.
Definition frame_D (R_wa : mat T) (t_a t_b : vec T) : vec T := transpose_times R_wa (vsub t_b t_a).
Definition cso_vertex (R : mat T) (D a b : vec T) : vec T := vsub (vsub a (mat_times R b)) D.

(* engine/narrow/attempt.h: the gap along v, from two support values *)
Definition support_gap (D v : vec T) (value_a value_b : T) : T := sub (neg (dot v D)) (add value_a value_b).

(* engine/narrow/certify.cpp: the gap along n *)
Definition direction_gap (D n : vec T) (value_a value_b : T) : T := sub (dot n D) (add value_a value_b).

(* engine/narrow/certify.h: the point that a simplex's weights give. *)
Definition zero_ : T := whole 0.
Definition positive_part (w : T) : T := if less zero_ w then w else zero_.
Fixpoint weight_sum (ws : list T) (sum : T) : T :=
  match ws with nil => sum | w :: rest => weight_sum rest (add sum (positive_part w)) end.
Definition all_or (total : T) (one_else : T) : T := if less zero_ total then one_else else whole 1.
Fixpoint weighted (shares : list T) (vs : list (vec T)) (sum : T) (w : vec T) : vec T :=
  match shares, vs with
  | s :: ss, v :: rest => weighted ss rest sum (vadd w (vscale v (div s sum)))
  | _, _ => w
  end.
Definition shares (ws : list T) : list T :=
  match map positive_part ws with
  | nil => nil
  | s :: rest => all_or (weight_sum ws zero_) s :: rest
  end.
Definition simplex_point (ws : list T) (vs : list (vec T)) : vec T :=
  let total := weight_sum ws zero_ in
  weighted (shares ws) vs (all_or total total) (V zero_ zero_ zero_).

(* RunBounds, for a run with a direction v, a gap and a point w of the CSO *)
Definition run_lower (v : vec T) (gap radius scale extra round_units : T) : T :=
  lower_from_gap gap (norm v) radius (add (rounding_error (add lower_units round_units) scale) extra).
Definition run_upper (w : vec T) (radius scale extra round_units : T) : T :=
  upper_from_point (norm w) radius (add (rounding_error (add upper_units round_units) scale) extra).

(* engine/narrow/certify.cpp: the error term of PlacedPair, in the units of float64 *)
Definition placed_error (units scale : T) : T := rounding_error (div (mul units unit) unit) scale.
End Source.
