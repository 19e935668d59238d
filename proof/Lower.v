(* The lower bound: supports along a direction. *)
From Coq Require Import Reals Lra Psatz ZArith List.
From Flocq Require Import Raux.
From Clearance Require Import Arithmetic Model Vectors Rounding Bounds.
Open Scope R_scope.

Definition e60 := Eval vm_compute in (10 ^ 60)%Z.
Definition e61 := Eval vm_compute in (10 ^ 61)%Z.
Definition e190 := Eval vm_compute in (10 ^ 190)%Z.
Definition tiny := / IZR e190.

(* A support value: the largest computed product of a direction and a vertex. *)
Definition support (vs : list vec) (n : vec) (value : R) : Prop :=
  (exists v, In v vs /\ value = fdot n v) /\ (forall v, In v vs -> fdot n v <= value).

(* What the source computes from a gap. *)
Definition flower (gap length radius error : R) : R := fl (fl (fl (gap / length) - radius) - error).
Lemma lower_is : @Model.lower_from_gap binary64 = flower.
Proof. reflexivity. Qed.

Lemma support_above : forall vs n value rho p, support vs n value -> (forall v, In v vs -> len v <= rho) -> hull vs p ->
  inner n p <= value + c3 * (len n * rho) + 7 * eta.
Proof.
  intros vs n value rho p [_ H] Hr Hp. revert p Hp. apply hull_functional. intros v Hv.
  pose proof (fdot_err n v) as E. apply Rabs_le_inv in E. specialize (H v Hv). specialize (Hr v Hv).
  assert (len n * len v <= len n * rho) by (apply Rmult_le_compat_l; [apply len_pos|assumption]).
  unfold c3 in *. pose proof u_pos. nra.
Qed.
Lemma support_size : forall vs n value rho, support vs n value -> (forall v, In v vs -> len v <= rho) ->
  Rabs value <= (1 + c3) * (len n * rho) + 7 * eta.
Proof.
  intros vs n value rho [[v [Hv ->]] _] Hr. specialize (Hr v Hv).
  pose proof (fdot_err n v) as E. pose proof (cauchy_abs n v) as C.
  assert (len n * len v <= len n * rho) by (apply Rmult_le_compat_l; [apply len_pos|assumption]).
  replace (fdot n v) with (inner n v + (fdot n v - inner n v)) by ring.
  eapply Rle_trans; [apply Rabs_triang|]. unfold c3 in *. pose proof u_pos. nra.
Qed.

(* Division of an inequality by the length of n, with what underflow adds. *)
Lemma divide : forall N X Y t, 0 < N -> X <= N * Y + t -> t <= N * tiny -> X / N <= Y + tiny.
Proof.
  intros N X Y t HN H Ht. apply Rmult_le_reg_l with N; [assumption|].
  unfold Rdiv. rewrite <- Rmult_assoc, (Rmult_comm N X), Rmult_assoc, Rinv_r by lra. lra.
Qed.
Lemma divide_abs : forall N X Y t, 0 < N -> Rabs X <= N * Y + t -> t <= N * tiny -> Rabs (X / N) <= Y + tiny.
Proof.
  intros N X Y t HN H Ht. unfold Rdiv. rewrite Rabs_mult, (Rabs_pos_eq (/ N)) by (left; apply Rinv_0_lt_compat; assumption).
  apply (divide N _ _ t); assumption.
Qed.

(* The arithmetic of it, over reals: n has length N, computed as L; the exact gap is d - pa - pb. *)
Lemma lower_core : forall N L D rho_a rho_b r_a r_b pa pb d sa sb dh error,
  / IZR e60 <= N -> 0 <= D -> 0 <= rho_a -> 0 <= rho_b <= IZR e61 -> 0 <= r_a -> 0 <= r_b ->
  pa <= sa + c3 * (N * rho_a) + 7 * eta ->
  pb <= sb + 20.6611 * u * (N * rho_b) + (7 * eta + 15 * eta * rho_b) ->
  Rabs (dh - d) <= 10.9285 * u * (N * D) + (7 * eta + 18 * eta * N) ->
  Rabs d <= N * D ->
  Rabs sa <= (1 + c3) * (N * rho_a) + 7 * eta ->
  Rabs sb <= (1 + 21 * u) * (N * rho_b) + (7 * eta + 15 * eta * rho_b) ->
  Rabs (L - N) <= 2.53 * u * N ->
  30 * u * (D + rho_a + rho_b + (r_a + r_b)) + 0.9 * margin <= error ->
  flower (fl (dh - fl (sa + sb))) L (fl (r_a + r_b)) error <= (d - pa - pb) / N - r_a - r_b.
Proof.
  intros N L D a b ra rb pa pb d sa sb dh error HN HD Ha [Hb Hb'] Hra Hrb H1 H2 H3 H4 H5 H6 HL HE.
  pose proof eta_small as Eta. assert (N0 : 0 < N) by (unfold e60 in HN; lra).
  assert (T1 : 7 * eta <= N * tiny) by (unfold e323, e60, tiny, e190 in *; lra).
  assert (T2 : 7 * eta + 15 * eta * b <= N * tiny).
  { assert (eta * b <= / IZR e323 * IZR e61) by (apply Rmult_le_compat; lra).
    unfold e323, e60, tiny, e190, e61 in *. lra. }
  assert (T3 : 7 * eta + 18 * eta * N <= N * tiny).
  { assert (eta * N <= / IZR e323 * N) by (apply Rmult_le_compat_r; lra). unfold e323, e60, tiny, e190, e61 in *. lra. }
  apply Rabs_le_inv in HL.
  (* everything over N *)
  assert (K1 : (pa - sa) / N <= c3 * a + tiny) by (apply (divide _ _ _ (7 * eta)); [assumption| |assumption]; lra).
  assert (K2 : (pb - sb) / N <= 20.6611 * u * b + tiny) by (eapply divide; [assumption| |exact T2]; lra).
  assert (K3 : Rabs ((dh - d) / N) <= 10.9285 * u * D + tiny) by (eapply divide_abs; [assumption| |exact T3]; lra).
  assert (K4 : Rabs (d / N) <= D + tiny) by (apply (divide_abs _ _ _ 0); [assumption| |unfold tiny, e190; nra]; lra).
  assert (K5 : Rabs (sa / N) <= (1 + c3) * a + tiny) by (eapply divide_abs; [assumption| |exact T1]; lra).
  assert (K6 : Rabs (sb / N) <= (1 + 21 * u) * b + tiny) by (eapply divide_abs; [assumption| |exact T2]; lra).
  assert (Ke : eta / N <= tiny) by (replace (eta / N) with ((0 + eta) / N) by (f_equal; ring);
    rewrite <- (Rplus_0_l tiny); apply (divide _ _ _ eta); lra).
  set (s := fl (sa + sb)) in *. set (gap := fl (dh - s)) in *.
  pose proof (fl_err (sa + sb)) as Es. fold s in Es. pose proof (fl_err (dh - s)) as Eg. fold gap in Eg.
  assert (Hi : 0 < / N) by (apply Rinv_0_lt_compat; assumption).
  assert (over : forall X e Y, Rabs X <= e * Rabs Y + eta -> Rabs (X / N) <= e * Rabs (Y / N) + tiny).
  { intros X e Y HX. unfold Rdiv. rewrite !Rabs_mult, (Rabs_pos_eq (/ N)) by lra.
    assert (Rabs X * / N <= (e * Rabs Y + eta) * / N) by (apply Rmult_le_compat_r; lra).
    unfold Rdiv in Ke. lra. }
  apply over in Es, Eg.
  replace ((s - (sa + sb)) / N) with (s / N - (sa / N + sb / N)) in Es by (field; lra).
  replace ((sa + sb) / N) with (sa / N + sb / N) in Es by (field; lra).
  replace ((gap - (dh - s)) / N) with (gap / N - (dh / N - s / N)) in Eg by (field; lra).
  replace ((dh - s) / N) with (dh / N - s / N) in Eg by (field; lra).
  replace ((pa - sa) / N) with (pa / N - sa / N) in K1 by (field; lra).
  replace ((pb - sb) / N) with (pb / N - sb / N) in K2 by (field; lra).
  replace ((dh - d) / N) with (dh / N - d / N) in K3 by (field; lra).
  replace ((d - pa - pb) / N) with (d / N - pa / N - pb / N) by (field; lra).
  unfold flower. assert (L0 : 0 < L) by num.
  assert (Kk : exists k, gap / L = gap / N * k /\ 1 - 2.54 * u <= k <= 1 + 2.54 * u).
  { exists (N / L). split; [field; lra|]. split.
    - apply Rmult_le_reg_r with L; [assumption|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. num.
    - apply Rmult_le_reg_r with L; [assumption|]. unfold Rdiv. rewrite (Rmult_assoc N), Rinv_l by lra. num. }
  destruct Kk as (k & -> & Hk).
  set (A := sa / N) in *. set (B := sb / N) in *. set (X := dh / N) in *. set (S := s / N) in *. set (G := gap / N) in *.
  set (Pa := pa / N) in *. set (Pb := pb / N) in *. set (Dd := d / N) in *.
  clearbody A B X S G Pa Pb Dd. clear - Eta Es Eg K1 K2 K3 K4 K5 K6 Hk HE HD Ha Hb Hra Hrb.
  assert (M : Rabs (A + B) <= (1 + c3) * a + (1 + 21 * u) * b + 2 * tiny).
  { eapply Rle_trans; [apply Rabs_triang|]. lra. }
  assert (Bx : Rabs X <= D * (1 + 10.9285 * u) + 2 * tiny).
  { replace X with (Dd + (X - Dd)) by ring. eapply Rle_trans; [apply Rabs_triang|]. lra. }
  assert (Bs : Rabs S <= (1 + 23 * u) * (a + b) + 4 * tiny).
  { replace S with ((A + B) + (S - (A + B))) by ring. eapply Rle_trans; [apply Rabs_triang|].
    unfold c3, tiny, e190, u in *. lra. }
  assert (Bxs : Rabs (X - S) <= (1 + 23 * u) * (D + a + b) + 6 * tiny).
  { eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp. unfold u in *. lra. }
  assert (Bg : Rabs G <= (1 + 25 * u) * (D + a + b) + 8 * tiny).
  { replace G with ((X - S) + (G - (X - S))) by ring. eapply Rle_trans; [apply Rabs_triang|].
    unfold tiny, e190, u in *. lra. }
  assert (Bk : Rabs (G * k - G) <= 2.54 * u * Rabs G).
  { replace (G * k - G) with (G * (k - 1)) by ring. rewrite Rabs_mult, (Rmult_comm (Rabs G)).
    apply Rmult_le_compat_r; [apply Rabs_pos|]. apply Rabs_le. lra. }
  pose proof (fl_err (G * k)) as Eq.
  assert (Bgk : Rabs (G * k) <= (1 + 3 * u) * Rabs G).
  { replace (G * k) with (G + (G * k - G)) by ring. eapply Rle_trans; [apply Rabs_triang|].
    pose proof (Rabs_pos G). unfold u in *. lra. }
  set (q := fl (G * k)) in *. set (Q := G * k) in *.
  pose proof (fl_err (ra + rb)) as Er. rewrite (Rabs_pos_eq (ra + rb)) in Er by lra. set (r := fl (ra + rb)) in *.
  assert (Bq : Rabs q <= (1 + 30 * u) * (D + a + b) + 10 * tiny).
  { replace q with (Q + (q - Q)) by ring. eapply Rle_trans; [apply Rabs_triang|].
    unfold e323, tiny, e190, u in *. lra. }
  assert (Br : Rabs r <= (1 + 2 * u) * (ra + rb) + eta).
  { replace r with ((ra + rb) + (r - (ra + rb))) by ring. eapply Rle_trans; [apply Rabs_triang|].
    rewrite (Rabs_pos_eq (ra + rb)) by lra. unfold u in *. lra. }
  pose proof (fl_err (q - r)) as E1.
  assert (B1 : Rabs (q - r) <= Rabs q + Rabs r) by (eapply Rle_trans; [apply Rabs_triang|]; rewrite Rabs_Ropp; lra).
  set (y := fl (q - r)) in *.
  assert (By : Rabs y <= (1 + 40 * u) * (D + a + b + (ra + rb)) + 20 * tiny).
  { replace y with ((q - r) + (y - (q - r))) by ring. eapply Rle_trans; [apply Rabs_triang|].
    unfold e323, tiny, e190, u in *. lra. }
  pose proof (fl_err (y - error)) as E2.
  assert (B2 : Rabs (y - error) <= Rabs y + Rabs error) by (eapply Rle_trans; [apply Rabs_triang|]; rewrite Rabs_Ropp; lra).
  assert (He : 0 <= error).
  { eapply Rle_trans; [|exact HE]. unfold margin, e150, u. lra. }
  rewrite (Rabs_pos_eq error) in B2 by assumption.
  set (z := fl (y - error)) in *.
  apply Rabs_le_inv in Es, Eg, K3, Bk, Eq, Er, E1, E2.
  unfold c3, margin, e150, tiny, e190, e323, u in *. lra.
Qed.
