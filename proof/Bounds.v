(* The error term of a bound is large enough: S is rounded up, and the constants cover what Lower.v and Upper.v need. *)
From Coq Require Import Reals Lra Psatz ZArith.
From Flocq Require Import Raux.
From Clearance Require Import Arithmetic Model Vectors Rounding.
Open Scope R_scope.

Definition e150 := Eval vm_compute in (10 ^ 150)%Z.
Definition margin := / IZR e150.   (* 10^-150 *)

Definition fscale (D : vec) (rho_a rho_b radius : R) : R :=
  fl (fl (fl (fl (fnorm D + rho_a) + rho_b) + radius) * fl (1 + fl (32 * u))).
Definition ferror (units scale : R) : R :=
  fl (fl (fl (fl (units * u) * scale) * fl (1 + fl (16 * u))) + fl (1 * ten_to (-150))).
Lemma scale_is : @Model.pair_scale binary64 = fscale.
Proof. unfold fscale. rewrite u_is. reflexivity. Qed.
Lemma error_is : @Model.rounding_error binary64 = ferror.
Proof. unfold ferror. rewrite u_is. reflexivity. Qed.

Lemma fl_low : forall a b, b <= a -> 0 <= b -> b * (1 - u) - eta <= fl a.
Proof.
  intros a b H Hb. pose proof (fl_err b) as E. rewrite (Rabs_pos_eq b) in E by assumption.
  apply Rabs_le_inv in E. pose proof (fl_le b a H). lra.
Qed.
Lemma fl_low' : forall a, 0 <= a -> a * (1 - u) - eta <= fl a.
Proof. intros. apply fl_low; lra. Qed.

Ltac small := pose proof eta_small; unfold e323, h, e161, margin, e150, u in *.

Lemma one_and : forall k, 2 <= k <= 100 -> 1 + (k - 2) * u <= fl (1 + fl (k * u)).
Proof.
  intros k H. assert (A : 0 <= k * u) by (pose proof u_pos; nra).
  pose proof (fl_low' (k * u) A) as H1. pose proof (fl_pos _ A).
  pose proof (fl_low' (1 + fl (k * u)) ltac:(lra)) as H2. small. lra.
Qed.

Lemma margin_rounded : 0.99 * margin <= fl (1 * ten_to (-150)).
Proof.
  assert (E : 1 * ten_to (-150) = margin).
  { unfold ten_to, margin, e150. rewrite Rmult_1_l. reflexivity. }
  rewrite E. pose proof (fl_low' margin ltac:(unfold margin, e150; lra)). small. lra.
Qed.

Lemma error_at_least : forall units scale S, 30 <= units <= 50 -> 0 <= scale -> S - 4 * h <= scale -> 0 <= S ->
  units * u * S + 0.9 * margin <= ferror units scale.
Proof.
  intros units scale S HU Hs HS S0. unfold ferror. pose proof u_pos as U. pose proof eta_pos as P.
  assert (A : 0 <= units * u) by nra.
  pose proof (fl_low' _ A) as E0. pose proof (fl_pos _ A) as E0'. set (e0 := fl (units * u)) in *.
  assert (E0'' : units * u * (1 - 2 * u) <= e0).
  { assert (30 * u * u <= units * u * u) by nra. clear HS. small. nra. }
  assert (B : units * u * (1 - 2 * u) * scale <= e0 * scale) by nra.
  assert (X0 : 0 <= units * u * scale) by nra.
  set (X := units * u * scale) in *. replace (units * u * (1 - 2 * u) * scale) with (X * (1 - 2 * u)) in B by (unfold X; ring).
  assert (E1 : X * (1 - 2 * u) * (1 - u) - eta <= fl (e0 * scale)).
  { apply fl_low; [assumption|]. apply Rmult_le_pos; [assumption|]. num. }
  assert (E1' : 0 <= fl (e0 * scale)) by (apply fl_pos, Rmult_le_pos; assumption).
  set (e1 := fl (e0 * scale)) in *.
  pose proof (one_and 16 ltac:(lra)) as C. set (c := fl (1 + fl (16 * u))) in *.
  assert (D : e1 * (1 + 14 * u) <= e1 * c) by (apply Rmult_le_compat_l; lra).
  assert (E2 : e1 * (1 + 14 * u) * (1 - u) - eta <= fl (e1 * c)) by (apply fl_low; nra).
  assert (E2' : 0 <= fl (e1 * c)) by (apply fl_pos; nra).
  set (e2 := fl (e1 * c)) in *.
  pose proof margin_rounded as M. set (d := fl (1 * ten_to (-150))) in *.
  assert (Md : 0 <= d) by (eapply Rle_trans; [|exact M]; unfold margin, e150; lra).
  pose proof (fl_low' (e2 + d) ltac:(lra)) as E3.
  assert (Q : units * u * S <= X + 50 * u * (4 * h)).
  { unfold X. pose proof h_pos. assert (units * u * (S - 4 * h) <= units * u * scale) by (apply Rmult_le_compat_l; assumption).
    assert (units * u * (4 * h) <= 50 * u * (4 * h)) by (repeat apply Rmult_le_compat_r; lra). lra. }
  clearbody X e0 e1 c e2 d. clear - Q E3 M E2 E1 X0 U P. small. lra.
Qed.

(* S: at least |D| + rho_a + rho_b + r_a + r_b, up to underflow of the squares. *)
Lemma scale_at_least : forall D' D rho_a rho_b r_a r_b,
  len (minus D' D) <= kOffset * len D + 17 * eta -> 0 <= rho_a -> 0 <= rho_b -> 0 <= r_a -> 0 <= r_b ->
  0 <= fscale D' rho_a rho_b (fl (r_a + r_b)) /\
  len D + rho_a + rho_b + (r_a + r_b) - 4 * h <= fscale D' rho_a rho_b (fl (r_a + r_b)).
Proof.
  intros D' D ra rb r s H Ha Hb Hr Hs. unfold fscale.
  pose proof (fnorm_err D') as [N _]. pose proof (fnorm_pos D') as N0. pose proof (len_near D D') as L.
  rewrite len_minus_comm in L. pose proof (len_pos D) as L0. pose proof (len_pos D') as L1.
  set (n := fnorm D') in *. set (l := len D) in *. set (l' := len D') in *.
  pose proof (fl_low' (r + s) ltac:(lra)) as R1. pose proof (fl_pos (r + s) ltac:(lra)) as R0. set (rs := fl (r + s)) in *.
  pose proof (fl_low' (n + ra) ltac:(lra)) as S1. pose proof (fl_pos (n + ra) ltac:(lra)) as S1'. set (s1 := fl (n + ra)) in *.
  pose proof (fl_low' (s1 + rb) ltac:(lra)) as S2. pose proof (fl_pos (s1 + rb) ltac:(lra)) as S2'. set (s2 := fl (s1 + rb)) in *.
  pose proof (fl_low' (s2 + rs) ltac:(lra)) as S3. pose proof (fl_pos (s2 + rs) ltac:(lra)) as S3'. set (s3 := fl (s2 + rs)) in *.
  pose proof (one_and 32 ltac:(lra)) as C. set (c := fl (1 + fl (32 * u))) in *.
  pose proof u_pos as U.
  assert (P : s3 * (1 + 30 * u) <= s3 * c) by (apply Rmult_le_compat_l; lra).
  assert (F : s3 * (1 + 30 * u) * (1 - u) - eta <= fl (s3 * c)) by (apply fl_low; nra).
  split; [apply fl_pos; nra|].
  set (f := fl (s3 * c)) in *. unfold kOffset in H. clearbody n l l' rs s1 s2 s3 c f.
  small. lra.
Qed.
