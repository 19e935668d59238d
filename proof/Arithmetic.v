(* Arithmetic: the operations that the source uses, and binary64 as one instance of them. *)
From Coq Require Import Reals Lra ZArith Bool Psatz.
From Flocq Require Import Core Relative Plus_error.
Open Scope R_scope.

(* The operations of a scalar type T of the source, and its literals. [fold] rounds a literal that no binary64 equals. *)
Class arith := {
  T : Type;
  add : T -> T -> T;
  sub : T -> T -> T;
  mul : T -> T -> T;
  div : T -> T -> T;
  neg : T -> T;
  root : T -> T;
  less : T -> T -> bool;
  whole : Z -> T;            (* an integer *)
  two_to : Z -> T;           (* a power of two *)
  decimal : Z -> Z -> T      (* decimal m e: m * 10^e, e < 0 *)
}.

(* Rounding to nearest, ties to even, with 53 bits and denormals: no largest number. *)
Definition fl (x : R) : R := round radix2 (FLT_exp (-1074) 53) ZnearestE x.
Definition float (x : R) : Prop := generic_format radix2 (FLT_exp (-1074) 53) x.

Definition ten_to (e : Z) : R := / IZR (10 ^ (- e)).
#[global] Instance binary64 : arith := {
  T := R;
  add x y := fl (x + y);
  sub x y := fl (x - y);
  mul x y := fl (x * y);
  div x y := fl (x / y);
  neg x := - x;
  root x := fl (sqrt x);
  less x y := if Rlt_dec x y then true else false;
  whole m := IZR m;
  two_to e := bpow radix2 e;
  decimal m e := fl (IZR m * ten_to e)
}.

#[local] Instance precision : Prec_gt_0 53 := eq_refl.

Definition u : R := / 9007199254740992.        (* 2^-53 *)
Definition eta : R := / IZR (2 ^ 1075).

Lemma u_is : u = bpow radix2 (-53).
Proof. unfold u, bpow. simpl. lra. Qed.

Lemma eta_is : eta = / 2 * bpow radix2 (-1074).
Proof.
  unfold eta. change (bpow radix2 (-1074)) with (/ IZR (2 ^ 1074)).
  replace (2 ^ 1075)%Z with (2 * 2 ^ 1074)%Z by reflexivity.
  rewrite mult_IZR, Rinv_mult. reflexivity.
Qed.

Lemma eta_pos : 0 < eta.
Proof. unfold eta. apply Rinv_0_lt_compat, IZR_lt. reflexivity. Qed.

Lemma u_pos : 0 < u.
Proof. unfold u. lra. Qed.

(* The one fact about rounding that most of the proof uses. *)
Lemma fl_err : forall x, Rabs (fl x - x) <= u * Rabs x + eta.
Proof.
  intros x. unfold fl.
  destruct (error_N_FLT radix2 (-1074) 53 ltac:(reflexivity) (fun z => negb (Z.even z)) x) as (e & h & He & Hh & _ & E).
  rewrite E. rewrite u_is, eta_is.
  replace (x * (1 + e) + h - x) with (x * e + h) by ring.
  eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult.
  assert (Rabs e <= bpow radix2 (-53)).
  { eapply Rle_trans; [exact He|]. simpl. lra. }
  pose proof (Rabs_pos x). apply Rplus_le_compat; [|exact Hh].
  rewrite (Rmult_comm (Rabs x)). apply Rmult_le_compat_r; assumption.
Qed.

Lemma fl_format : forall x, float (fl x).
Proof. intros x. apply generic_format_round; apply _. Qed.

Lemma fl_exact : forall x, float x -> fl x = x.
Proof. intros x H. apply round_generic; [apply _|exact H]. Qed.

Lemma fl_0 : fl 0 = 0.
Proof. apply round_0. apply _. Qed.

Lemma float_0 : float 0.
Proof. apply generic_format_0. Qed.

Lemma fl_le : forall x y, x <= y -> fl x <= fl y.
Proof. intros x y H. apply round_le; try apply _. exact H. Qed.

Lemma fl_pos : forall x, 0 <= x -> 0 <= fl x.
Proof. intros x H. pose proof (fl_le 0 x H) as L. rewrite fl_0 in L. exact L. Qed.

Lemma fl_opp : forall x, fl (- x) = - fl x.
Proof. intros x. apply round_NE_opp. Qed.

(* Sums of floats do not underflow. *)
Lemma fl_sum : forall x y, float x -> float y -> 0 <= x -> 0 <= y ->
  (x + y) * (1 - u) <= fl (x + y) <= (x + y) * (1 + u).
Proof.
  intros x y Fx Fy Hx Hy.
  destruct (FLT_plus_error_N_ex radix2 (-1074) 53 (fun z => negb (Z.even z)) x y Fx Fy) as (e & He & E).
  unfold fl. rewrite E.
  assert (Hu : u_ro radix2 53 = u).
  { unfold u_ro. rewrite u_is. simpl. lra. }
  rewrite Hu in He.
  assert (Rabs e <= u).
  { eapply Rle_trans; [exact He|]. pose proof u_pos.
    apply Rmult_le_reg_r with (1 + u); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. nra. }
  apply Rabs_le_inv in H. pose proof u_pos. split; nra.
Qed.

Lemma fl_one : float 1.
Proof. change 1 with (bpow radix2 0). apply generic_format_bpow. vm_compute. discriminate. Qed.
