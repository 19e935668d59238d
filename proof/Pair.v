(* The interval of two convex parts in float64, from the frame of a to both bounds. *)
From Coq Require Import Reals Lra Psatz ZArith List.
From Flocq Require Import Raux.
From Clearance Require Import Arithmetic Model Vectors Rounding Bounds Lower Point Upper.
Open Scope R_scope.

Lemma hull_len : forall vs rho p, (forall v, In v vs -> len v <= rho) -> hull vs p -> len p <= rho.
Proof.
  intros vs rho p H Hp. induction Hp as [v Hv|t p q Ht Hp IHp Hq IHq]; [apply H; assumption|].
  eapply Rle_trans; [apply triangle|]. rewrite !len_times, !Rabs_pos_eq by lra. nra.
Qed.

Definition opposite (v : vec) : vec := V (- x v) (- y v) (- z v).
Lemma fdot_opposite : forall v w, fdot (opposite v) w = - fdot v w.
Proof.
  intros v w. unfold fdot, opposite. cbn [x y z].
  rewrite !Ropp_mult_distr_l_reverse, !fl_opp, <- Ropp_plus_distr, fl_opp, <- Ropp_plus_distr, fl_opp. reflexivity.
Qed.
Lemma fnorm_opposite : forall v, fnorm (opposite v) = fnorm v.
Proof. intros v. unfold fnorm, fdot, opposite. cbn [x y z]. rewrite !Rmult_opp_opp. reflexivity. Qed.
Lemma len_opposite : forall v, len (opposite v) = len v.
Proof. intros v. unfold len, inner, opposite. cbn [x y z]. rewrite !Rmult_opp_opp. reflexivity. Qed.
Lemma fapply_opposite : forall m v, fapply m (opposite v) = opposite (fapply m v).
Proof.
  assert (K : forall v w, fdot v (opposite w) = - fdot v w).
  { intros v w. unfold fdot, opposite. cbn [x y z].
    rewrite !Ropp_mult_distr_r_reverse, !fl_opp, <- Ropp_plus_distr, fl_opp, <- Ropp_plus_distr, fl_opp. reflexivity. }
  intros m v. unfold fapply. rewrite !K. reflexivity.
Qed.
Lemma opposite_twice : forall v, opposite (opposite v) = v.
Proof. intros [a b c]. unfold opposite. cbn [x y z]. rewrite !Ropp_involutive. reflexivity. Qed.

(* Two placed parts: exact geometry (va, r_a, A, tA, ...), and the rotations A', B' that the source has of A, B. *)
Record placed_pair := {
  va : list vec; vb : list vec;        (* stored vertices *)
  rho_a : R; rho_b : R;                (* at least their distances from the origin *)
  r_a : R; r_b : R;                    (* radii *)
  A : mat; B : mat; A' : mat; B' : mat;
  tA : vec; tB : vec }.
Record sound (P : placed_pair) : Prop := {
  vertices_a : forall v, In v (va P) -> len v <= rho_a P;
  vertices_b : forall v, In v (vb P) -> len v <= rho_b P;
  rho_a_pos : 0 <= rho_a P;
  rho_b_pos : 0 <= rho_b P <= IZR e61;
  r_a_pos : 0 <= r_a P;
  r_b_pos : 0 <= r_b P;
  rotation_a : rounded_rotation (A' P) (A P);
  rotation_b : rounded_rotation (B' P) (B P) }.

Definition part_a (P : placed_pair) (p : vec) : Prop := exists c, part (va P) (r_a P) c /\ p = placed (A P) (tA P) c.
Definition part_b (P : placed_pair) (p : vec) : Prop := exists c, part (vb P) (r_b P) c /\ p = placed (B P) (tB P) c.

Definition frame (P : placed_pair) : mat := fturned (A' P) (B' P).
Definition offset (P : placed_pair) : vec := fapply (transposed (A' P)) (fsub (tB P) (tA P)).
Definition radius (P : placed_pair) : R := fl (r_a P + r_b P).
Definition scale (P : placed_pair) : R := fscale (offset P) (rho_a P) (rho_b P) (radius P).
Definition exact_R (P : placed_pair) : mat := turned (A P) (B P).
Definition exact_D (P : placed_pair) : vec := apply (transposed (A P)) (minus (tB P) (tA P)).

Lemma offset_near : forall P, sound P ->
  len (minus (offset P) (exact_D P)) <= kOffset * len (exact_D P) + 17 * eta.
Proof.
  intros P H. unfold exact_D at 2. rewrite len_rotated_back by apply (proj1 (rotation_a P H)).
  apply offset_err, (rotation_a P H).
Qed.

Lemma error_covers : forall P units, sound P -> 30 <= units <= 50 ->
  units * u * (len (exact_D P) + rho_a P + rho_b P + (r_a P + r_b P)) + 0.9 * margin <= ferror units (scale P).
Proof.
  intros P units H HU. destruct (scale_at_least (offset P) (exact_D P) (rho_a P) (rho_b P) (r_a P) (r_b P)) as [S0 S1];
    try apply H; [apply offset_near; assumption|].
  pose proof (len_pos (exact_D P)). apply error_at_least; try assumption. destruct H. lra.
Qed.

(* The lower bound along n. [back] is the direction in the axes of b, for supports of b. *)
Theorem lower_holds : forall P n back value_a value_b, sound P -> / IZR e60 <= len n ->
  back = opposite (fapply (transposed (frame P)) n) ->
  support (va P) n value_a -> support (vb P) back value_b ->
  forall p q, part_a P p -> part_b P q ->
  flower (fl (fdot n (offset P) - fl (value_a + value_b))) (fnorm n) (radius P) (ferror 30 (scale P)) <= distance p q.
Proof.
  intros P n back sa sb H HN -> Ha Hb p q (p' & (pc & Hpc & Hp) & ->) (q' & (qc & Hqc & Hq) & ->).
  set (back := opposite (fapply (transposed (frame P)) n)) in *.
  assert (N0 : 0 < len n) by (unfold e60 in HN; lra). set (N := len n) in *.
  pose proof (error_covers P 30 H ltac:(lra)) as HE. pose proof (offset_near P H) as HO.
  assert (HD0 := len_pos (exact_D P)). pose proof eta_small as Eta.
  destruct H as [Va Vb Ra [Rb Rb'] rra rrb RA RB].
  rewrite relative_frame by apply (proj1 RA). fold (exact_D P) (exact_R P).
  assert (Bk : len (plus back (apply (transposed (exact_R P)) n)) <= kTurn * N + 14 * eta).
  { rewrite <- len_opposite.
    replace (opposite (plus back (apply (transposed (exact_R P)) n)))
      with (minus (fapply (transposed (frame P)) n) (apply (transposed (exact_R P)) n)).
    - apply turn_back_err; assumption.
    - unfold back, opposite, minus, plus. cbn [x y z]. f_equal; ring. }
  assert (Rn : len (apply (transposed (exact_R P)) n) = N).
  { apply len_rotated_back. apply rotation_turned; [apply (proj1 RA)|apply (proj1 RB)]. }
  assert (Lb : len back <= (1 + kTurn) * N + 14 * eta).
  { pose proof (len_near back (times (-1) (apply (transposed (exact_R P)) n))) as L.
    rewrite len_times in L. replace (Rabs (-1)) with 1 in L by (rewrite Rabs_left; lra).
    replace (minus back (times (-1) (apply (transposed (exact_R P)) n)))
      with (plus back (apply (transposed (exact_R P)) n)) in L by veq. lra. }
  pose proof (hull_len _ _ _ Vb Hqc) as Lq. pose proof (len_pos qc) as Lq0.
  assert (LbR : len back * rho_b P <= ((1 + kTurn) * N + 14 * eta) * rho_b P) by (apply Rmult_le_compat_r; lra).
  assert (E2 : forall k : R, 0 <= k -> 0 <= k * rho_b P) by (intros; apply Rmult_le_pos; lra).
  pose proof (E2 eta ltac:(lra)) as P1. pose proof (E2 N ltac:(lra)) as P2.
  set (d := inner n (exact_D P)). set (pa := inner n pc). set (pb := - inner n (apply (exact_R P) qc)).
  apply Rle_trans with ((d - pa - pb) / N - r_a P - r_b P).
  - apply (lower_core N (fnorm n) (len (exact_D P)) (rho_a P) (rho_b P) (r_a P) (r_b P)); try assumption; try lra.
    + apply (support_above (va P)); assumption.
    + pose proof (support_above (vb P) back sb (rho_b P) qc Hb Vb Hqc) as S1.
      assert (S2 : pb <= inner back qc + (kTurn * N + 14 * eta) * rho_b P).
      { assert (pb = inner back qc - inner (plus back (apply (transposed (exact_R P)) n)) qc) as ->.
        { unfold pb. rewrite (inner_comm n), adjoint, (inner_comm qc).
          coords. ring. }
        pose proof (cauchy_abs (plus back (apply (transposed (exact_R P)) n)) qc) as C. apply Rabs_le_inv in C.
        assert (len (plus back (apply (transposed (exact_R P)) n)) * len qc <= (kTurn * N + 14 * eta) * rho_b P).
        { apply Rmult_le_compat; try apply len_pos; assumption. }
        lra. }
      clearbody pb back. clear - S1 S2 LbR P1 P2 Eta. set (i := inner back qc) in *.
      set (g := rho_b P) in *.
      replace ((kTurn * N + 14 * eta) * g) with (kTurn * (N * g) + 14 * (eta * g)) in S2 by ring.
      replace (((1 + kTurn) * N + 14 * eta) * g) with ((1 + kTurn) * (N * g) + 14 * (eta * g)) in LbR by ring.
      replace (15 * eta * g) with (15 * (eta * g)) by ring.
      unfold c3, kTurn, u in *. lra.
    + pose proof (fdot_err n (offset P)) as F. fold N in F.
      assert (G : Rabs (inner n (offset P) - d) <= N * (kOffset * len (exact_D P) + 17 * eta)).
      { unfold d. replace (inner n (offset P) - inner n (exact_D P)) with (inner n (minus (offset P) (exact_D P))) by (coords; ring).
        eapply Rle_trans; [apply cauchy_abs|]. apply Rmult_le_compat_l; [lra|assumption]. }
      assert (K : N * len (offset P) <= N * ((1 + kOffset) * len (exact_D P) + 17 * eta)).
      { apply Rmult_le_compat_l; [lra|]. pose proof (len_near (offset P) (exact_D P)). lra. }
      replace (fdot n (offset P) - d) with ((fdot n (offset P) - inner n (offset P)) + (inner n (offset P) - d)) by ring.
      eapply Rle_trans; [apply Rabs_triang|].
      assert (0 <= N * len (exact_D P)) by (apply Rmult_le_pos; lra). assert (0 <= N * eta) by (apply Rmult_le_pos; lra).
      clear - F G K Eta H H0. set (l := len (exact_D P)) in *.
      replace (N * (kOffset * l + 17 * eta)) with (kOffset * (N * l) + 17 * (N * eta)) in G by ring.
      replace (N * ((1 + kOffset) * l + 17 * eta)) with ((1 + kOffset) * (N * l) + 17 * (N * eta)) in K by ring.
      replace (18 * eta * N) with (18 * (N * eta)) by ring. set (nl := N * l) in *. set (ne := N * eta) in *.
      set (lo := N * len (offset P)) in *.
      unfold c3, kOffset, u in *. lra.
    + apply cauchy_abs.
    + apply (support_size (va P)); assumption.
    + pose proof (support_size (vb P) back sb (rho_b P) Hb Vb) as S1. eapply Rle_trans; [exact S1|].
      set (g := rho_b P) in *.
      replace (((1 + kTurn) * N + 14 * eta) * g) with ((1 + kTurn) * (N * g) + 14 * (eta * g)) in LbR by ring.
      replace (15 * eta * g) with (15 * (eta * g)) by ring.
      clear - LbR P1 P2 Eta. unfold c3, kTurn, u in *. lra.
    + destruct (fnorm_err n) as [F1 F2]. fold N in F1, F2. apply Rabs_le.
      clear - F1 F2 HN. unfold h, e161, e60, u in *. lra.
  - (* the exact gap along n bounds the distance *)
    set (w := minus (plus (apply (exact_R P) q') (exact_D P)) p').
    assert (C : inner n w <= N * len w) by apply cauchy.
    assert (Ew : inner n w = d - pa - pb + inner n (apply (exact_R P) (minus q' qc)) - inner n (minus p' pc)).
    { unfold d, pa, pb, w. rewrite apply_minus. coords. ring. }
    pose proof (cauchy_abs n (apply (exact_R P) (minus q' qc))) as C1.
    rewrite len_rotated in C1 by (apply rotation_turned; [apply (proj1 RA)|apply (proj1 RB)]).
    pose proof (cauchy_abs n (minus p' pc)) as C2. fold N in C1, C2. apply Rabs_le_inv in C1, C2.
    assert (N * len (minus q' qc) <= N * r_b P) by (apply Rmult_le_compat_l; lra).
    assert (N * len (minus p' pc) <= N * r_a P) by (apply Rmult_le_compat_l; lra).
    apply Rmult_le_reg_l with N; [assumption|].
    replace (N * ((d - pa - pb) / N - r_a P - r_b P)) with (d - pa - pb - N * r_a P - N * r_b P) by (field; lra).
    lra.
Qed.

(* Growing two cores by their radii: parts that are not apart share a point. *)
Lemma grown : forall P ca cb, sound P -> hull (va P) ca -> hull (vb P) cb ->
  let core := distance (placed (A P) (tA P) ca) (placed (B P) (tB P) cb) in
  exists p q, part_a P p /\ part_b P q /\ distance p q <= Rmax 0 (core - r_a P - r_b P).
Proof.
  intros P ca cb H Ha Hb core. destruct H as [_ _ _ _ rra rrb [RA _] [RB _]].
  set (p := placed (A P) (tA P) ca) in *. set (q := placed (B P) (tB P) cb) in *. set (d := minus q p).
  assert (D0 : 0 <= core) by apply len_pos.
  assert (Move : forall m t c (r k : R) vs, rotation m -> hull vs c -> 0 <= r -> Rabs k * core <= r ->
    exists c', part vs r c' /\ plus (placed m t c) (times k d) = placed m t c').
  { intros m t c r k vs Hm Hc Hr Hk. exists (plus c (apply (transposed m) (times k d))). split.
    - exists c. split; [assumption|].
      replace (minus (plus c (apply (transposed m) (times k d))) c) with (apply (transposed m) (times k d)) by veq.
      rewrite len_rotated_back by apply Hm. rewrite len_times. exact Hk.
    - unfold placed. rewrite apply_plus, back_and_forth by apply Hm. veq. }
  assert (Split : exists s t, 0 <= s /\ 0 <= t /\ s + t <= 1 /\ s * core <= r_a P /\ t * core <= r_b P /\
    (1 - s - t) * core <= Rmax 0 (core - r_a P - r_b P)).
  { destruct (Rle_lt_dec core (r_a P + r_b P)) as [K|K].
    - destruct (Rle_lt_dec (r_a P + r_b P) 0) as [Z|Z].
      + exists 0, 0. repeat split; try lra. eapply Rle_trans; [|apply Rmax_l]. lra.
      + exists (r_a P / (r_a P + r_b P)), (r_b P / (r_a P + r_b P)).
        assert (I : 0 < / (r_a P + r_b P)) by (apply Rinv_0_lt_compat; assumption).
        assert (S1 : r_a P / (r_a P + r_b P) + r_b P / (r_a P + r_b P) = 1) by (field; lra).
        assert (Q : core / (r_a P + r_b P) <= 1).
        { apply Rmult_le_reg_r with (r_a P + r_b P); [assumption|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra. }
        repeat split; try (apply Rmult_le_pos; lra); try lra.
        * replace (r_a P / (r_a P + r_b P) * core) with (r_a P * (core / (r_a P + r_b P))) by (field; lra). nra.
        * replace (r_b P / (r_a P + r_b P) * core) with (r_b P * (core / (r_a P + r_b P))) by (field; lra). nra.
        * eapply Rle_trans; [|apply Rmax_l]. nra.
    - exists (r_a P / core), (r_b P / core). assert (I : 0 < / core) by (apply Rinv_0_lt_compat; lra).
      assert (S1 : (r_a P + r_b P) / core <= 1).
      { apply Rmult_le_reg_r with core; [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra. }
      assert (Sa : r_a P / core * core = r_a P) by (field; lra). assert (Sb : r_b P / core * core = r_b P) by (field; lra).
      repeat split; try (apply Rmult_le_pos; lra); try lra.
      eapply Rle_trans; [|apply Rmax_r]. nra. }
  destruct Split as (s & t & Hs & Ht & Hst & Sa & Sb & Sd).
  destruct (Move (A P) (tA P) ca (r_a P) s (va P) RA Ha rra) as (p' & Hp & Ep); [rewrite Rabs_pos_eq by assumption; assumption|].
  destruct (Move (B P) (tB P) cb (r_b P) (- t) (vb P) RB Hb rrb) as (q' & Hq & Eq);
    [rewrite Rabs_Ropp, Rabs_pos_eq by assumption; assumption|].
  fold p in Ep. fold q in Eq.
  exists (plus p (times s d)), (plus q (times (- t) d)). split; [|split].
  - exists p'. split; assumption.
  - exists q'. split; assumption.
  - unfold distance at 1.
    replace (minus (plus q (times (- t) d)) (plus p (times s d))) with (times (1 - s - t) d) by (unfold d; veq).
    rewrite len_times, Rabs_pos_eq by lra. exact Sd.
Qed.

(* The upper bound from weights and pairs of vertices. *)
Theorem upper_holds : forall P ws ab, sound P -> (1 <= length ws <= 4)%nat -> length ab = length ws -> Forall float ws ->
  Forall (fun s => In (fst s) (va P) /\ In (snd s) (vb P)) ab ->
  exists p q, part_a P p /\ part_b P q /\
    distance p q <= Rmax 0 (fupper
      (fnorm (fpoint ws (map (fun s => fcso (frame P) (offset P) (fst s) (snd s)) ab)))
      (radius P) (ferror 34 (scale P))).
Proof.
  intros P ws ab H Hl Hn Hf Hab. pose proof (offset_near P H) as HO. pose proof (error_covers P 34 H ltac:(lra)) as HE.
  assert (HD0 := len_pos (exact_D P)). pose proof eta_small as Eta. pose proof u_pos as U.
  assert (H' := H). destruct H' as [Va Vb Ra [Rb _] rra rrb RA RB].
  set (S := len (exact_D P) + rho_a P + rho_b P) in *.
  set (W := (1 + 20 * u) * S + 40 * eta). set (ew := 19.67 * u * S + 40 * eta).
  assert (S0 : 0 <= S) by (unfold S; lra).
  destruct (point_sums (va P) (vb P) W ew (exact_R P) (exact_D P) ws
    (map (fun s => fcso (frame P) (offset P) (fst s) (snd s)) ab)) as (m & L & Hm & HL & ex & bulk & ca & cb & HL0 & D1 & D2 & D3 & Hca & Hcb);
    [assumption|rewrite map_length; assumption|assumption| |].
  { apply Forall_forall. intros v Hv. apply in_map_iff in Hv. destruct Hv as ((a & b) & <- & Hi).
    rewrite Forall_forall in Hab. destruct (Hab _ Hi) as [Ia Ib]. cbn [fst snd] in *. exists a, b.
    destruct (vertex_err (A' P) (A P) (B' P) (B P) (offset P) (exact_D P) a b (rho_a P) (rho_b P)) as [E1 E2]; auto. }
  destruct (grown P ca cb H Hca Hcb) as (p & q & Hp & Hq & Hd). exists p, q. split; [assumption|]. split; [assumption|].
  eapply Rle_trans; [exact Hd|]. apply Rle_max_compat_l.
  rewrite relative_frame by apply (proj1 RA). fold (exact_D P) (exact_R P).
  assert (Ec : len (minus (plus (apply (exact_R P) cb) (exact_D P)) ca) = len (cso (exact_R P) (exact_D P) ca cb)).
  { unfold cso. rewrite len_minus_comm. f_equal. veq. }
  rewrite Ec.
  apply (upper_core _ ex bulk m L W ew _ S (r_a P) (r_b P)); try assumption; try apply Rle_refl.
  - unfold W. nra.
  - unfold ew. nra.
Qed.
