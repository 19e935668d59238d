(* The claim, about the expressions as they stand in the source: the computed interval contains the exact distance.
   Print Assumptions at the end lists the axioms that it rests on. *)
From Coq Require Import Reals Lra Psatz ZArith List.
From Flocq Require Import Core.
From Clearance Require Import Arithmetic Model Vectors Rounding Bounds Lower Point Upper Pair Source Tie.
Import ListNotations.
Open Scope R_scope.

(* A support value: the largest of the computed products, as Source.scan_product computes them. *)
Definition largest (vs : list vec) (n : vec) (value : R) : Prop :=
  (exists v, In v vs /\ value = @Source.scan_product binary64 n v) /\
  (forall v, In v vs -> @Source.scan_product binary64 n v <= value).

(* No point of b is nearer to one of a than `lower`, and some are as near as `upper`: the exact distance, the infimum
   over all pairs, lies in [lower, max(0, upper)]. *)
Definition contains_distance (P : placed_pair) (lower upper : R) : Prop :=
  (forall p q, part_a P p -> part_b P q -> lower <= distance p q) /\
  (exists p q, part_a P p /\ part_b P q /\ distance p q <= Rmax 0 upper).

(* Vertices and weights of a simplex of 1 to 4 vertices; those from `size` on are not read. *)
Definition proper (P : placed_pair) (size : nat) (weights : list R) (corners : list (vec * vec)) : Prop :=
  (1 <= size <= 4)%nat /\ Forall float (firstn size weights) /\
  Forall (fun s => In (fst s) (va P) /\ In (snd s) (vb P)) (firstn size corners).

Lemma exact_integer : forall m e, (Z.abs m < 2 ^ 53)%Z -> (-1074 <= e)%Z -> float (IZR m * bpow radix2 e).
Proof. intros m e Hm He. apply generic_format_FLT. exists (Float radix2 m e); [reflexivity|exact Hm|exact He]. Qed.
Lemma float_whole : forall m, (Z.abs m < 2 ^ 53)%Z -> float (IZR m).
Proof.
  intros m H. replace (IZR m) with (IZR m * bpow radix2 0) by (cbn [bpow]; ring). apply exact_integer; [exact H|lia].
Qed.

Lemma run_error : forall units scale, (Z.abs units < 2 ^ 53)%Z ->
  fl (ferror (fl (IZR units + 0)) scale + 0) = ferror (IZR units) scale.
Proof.
  intros units scale H. rewrite !Rplus_0_r, (fl_exact (IZR units)) by (apply float_whole; exact H).
  apply fl_exact, fl_format.
Qed.
Lemma placed_error_is : forall units scale, (Z.abs units < 2 ^ 53)%Z ->
  @Model.placed_error binary64 (IZR units) scale = ferror (IZR units) scale.
Proof.
  intros units scale H. unfold Model.placed_error. rewrite error_is. f_equal.
  change (fl (fl (IZR units * bpow radix2 (-53)) / bpow radix2 (-53)) = IZR units).
  rewrite (fl_exact (IZR units * bpow radix2 (-53))) by (apply exact_integer; [exact H|lia]).
  replace (IZR units * bpow radix2 (-53) / bpow radix2 (-53)) with (IZR units).
  - apply fl_exact, float_whole, H.
  - field. apply Rgt_not_eq, bpow_gt_0.
Qed.

Definition e100 := Eval vm_compute in (10 ^ 100)%Z.
Definition scale' (P : placed_pair) : R := @Model.pair_scale binary64 (offset P) (rho_a P) (rho_b P) (radius P).
Lemma scale_is' : forall P, scale P = scale' P.
Proof. intros P. unfold scale', scale. rewrite scale_is. reflexivity. Qed.

(* The model's point of a simplex, spelled out. *)
Lemma positive_is : forall w, @Model.positive_part binary64 w = positive w.
Proof.
  intros w. unfold Model.positive_part, positive, Model.zero_. cbn [less whole binary64].
  destruct (Rlt_dec 0 w); reflexivity.
Qed.
Lemma or_one_is : forall t e, @Model.all_or binary64 t e = or_one t e.
Proof. intros t e. unfold Model.all_or, or_one, Model.zero_. cbn [less whole binary64]. destruct (Rlt_dec 0 t); reflexivity. Qed.
Lemma sum_is : forall ws s, @Model.weight_sum binary64 ws s = fsum ws s.
Proof.
  induction ws as [|w ws IH]; intros s; [reflexivity|].
  cbn [Model.weight_sum fsum]. rewrite positive_is. apply IH.
Qed.
Lemma weighted_is : forall ss vs t w, @Model.weighted binary64 ss vs t w = fweighted ss vs t w.
Proof. reflexivity. Qed.
Lemma point_is : forall ws vs, @Model.simplex_point binary64 ws vs = fpoint ws vs.
Proof.
  intros ws vs. unfold Model.simplex_point, fpoint. rewrite weighted_is.
  assert (E : @Model.shares binary64 ws = fshares ws).
  { unfold Model.shares, fshares. rewrite (map_ext _ positive positive_is).
    destruct (map positive ws); [reflexivity|]. rewrite or_one_is, sum_is. reflexivity. }
  rewrite E, or_one_is, sum_is. reflexivity.
Qed.

Definition corner (P : placed_pair) (s : vec * vec) : vec :=
  @Source.cso_vertex binary64 (frame P) (offset P) (fst s) (snd s).
Lemma simplex_is : forall P size w0 w1 w2 w3 s0 s1 s2 s3,
  @Source.simplex_point binary64 size w0 w1 w2 w3 (corner P s0) (corner P s1) (corner P s2) (corner P s3) =
  fpoint (firstn size [w0; w1; w2; w3])
    (map (fun s => fcso (frame P) (offset P) (fst s) (snd s)) (firstn size [s0; s1; s2; s3])).
Proof.
  intros P size w0 w1 w2 w3 s0 s1 s2 s3.
  pose proof (@simplex_point_tied binary64 size w0 w1 w2 w3 (corner P s0) (corner P s1) (corner P s2) (corner P s3)) as E.
  etransitivity; [exact E|]. clear E. etransitivity; [apply point_is|].
  apply f_equal. rewrite <- firstn_map. reflexivity.
Qed.

Lemma upper_part : forall P size w0 w1 w2 w3 s0 s1 s2 s3, sound P ->
  proper P size [w0; w1; w2; w3] [s0; s1; s2; s3] ->
  exists p q, part_a P p /\ part_b P q /\ distance p q <= Rmax 0 (fupper
    (fnorm (@Source.simplex_point binary64 size w0 w1 w2 w3 (corner P s0) (corner P s1) (corner P s2) (corner P s3)))
    (radius P) (ferror 34 (scale P))).
Proof.
  intros P size w0 w1 w2 w3 s0 s1 s2 s3 H (Hs & Hw & Hv).
  pose proof (simplex_is P size w0 w1 w2 w3 s0 s1 s2 s3) as E.
  set (w := @Source.simplex_point binary64 size w0 w1 w2 w3 (corner P s0) (corner P s1) (corner P s2) (corner P s3)) in *.
  clearbody w. subst w.
  assert (L : forall (S : Type) (a b c d : S), length (firstn size [a; b; c; d]) = size).
  { intros. rewrite firstn_length. cbn [length]. lia. }
  apply upper_holds; try assumption; rewrite !L; [exact Hs|reflexivity].
Qed.

(* A direction that passed the source's test of its squared length is long enough. *)
Lemma long_enough : forall v, @Source.safely_squared binary64 < @Source.squared_norm binary64 v -> / IZR e60 <= len v.
Proof.
  intros v H. change (fl (1 * ten_to (-100)) < fdot v v) in H.
  assert (E : / IZR e100 <= 1 * ten_to (-100)).
  { unfold ten_to. rewrite Rmult_1_l. apply Rle_refl. }
  pose proof (fl_low _ _ E ltac:(unfold e100; lra)) as L. pose proof (fdot_err v v) as D. rewrite <- len_sq in D.
  apply Rabs_le_inv in D. pose proof (len_pos v) as N. pose proof eta_small as Eta.
  apply Rnot_lt_le. intro K. assert (len v * len v <= / IZR e60 * / IZR e60) by (apply Rmult_le_compat; lra).
  assert (0 <= len v * len v) by nra. unfold c3, e100, e60, e323, u in *. lra.
Qed.

(* What the source computes, in the terms of Pair.v. *)
Lemma frame_is : forall P, @Source.frame_R binary64 (A' P) (B' P) = frame P.
Proof. intros P. rewrite frame_R_tied, turned_is. reflexivity. Qed.
Lemma offset_is : forall P, @Source.frame_D binary64 (A' P) (tA P) (tB P) = offset P.
Proof. intros P. rewrite frame_D_tied. reflexivity. Qed.
Lemma pair_scale_is : forall D a b r, @Source.pair_scale binary64 D a b r = fscale D a b r.
Proof. intros D a b r. rewrite pair_scale_tied, scale_is. reflexivity. Qed.
Lemma lanes_gap_is : forall D v a b, @Source.lanes_gap binary64 D v a b = fl (- fdot v D - fl (a + b)).
Proof. intros D v a b. rewrite lanes_gap_tied. reflexivity. Qed.
Lemma support_gap_is : forall D v a b, @Source.support_gap binary64 D v a b = fl (- fdot v D - fl (a + b)).
Proof. intros D v a b. rewrite support_gap_tied. reflexivity. Qed.
Lemma direction_gap_is : forall D n a b, @Source.direction_gap binary64 D n a b = fl (fdot n D - fl (a + b)).
Proof. intros D n a b. rewrite direction_gap_tied. reflexivity. Qed.
Lemma run_lower_is : forall v g r S, @Source.run_lower binary64 v g r S 0 0 = flower g (fnorm v) r (ferror 30 S).
Proof.
  intros v g r S. rewrite run_lower_tied. unfold Model.run_lower. rewrite lower_is, norm_is, error_is.
  apply f_equal. exact (run_error 30 S eq_refl).
Qed.
Lemma run_upper_is : forall w r S, @Source.run_upper binary64 w r S 0 0 = fupper (fnorm w) r (ferror 34 S).
Proof.
  intros w r S. rewrite run_upper_tied. unfold Model.run_upper. rewrite upper_is, norm_is, error_is.
  apply f_equal. exact (run_error 34 S eq_refl).
Qed.
Lemma placed_lower_is : forall g n r S,
  @Source.placed_lower binary64 g (@Source.norm binary64 n) r
    (@Source.placed_error binary64 (@Source.lower_units binary64) S) = flower g (fnorm n) r (ferror 30 S).
Proof.
  intros g n r S. rewrite placed_lower_tied, norm_tied, lower_is, norm_is, placed_error_tied.
  apply f_equal. exact (placed_error_is 30 S eq_refl).
Qed.
Lemma placed_upper_is : forall w r S,
  @Source.placed_upper binary64 w r (@Source.placed_error binary64 (@Source.upper_units binary64) S) =
  fupper (fnorm w) r (ferror 34 S).
Proof.
  intros w r S. rewrite placed_upper_tied, upper_is, norm_is, placed_error_tied.
  apply f_equal. exact (placed_error_is 34 S eq_refl).
Qed.
Lemma largest_is : forall vs n value, largest vs n value -> support vs n value.
Proof.
  intros vs n value [[v [Hv E]] H]. rewrite scan_product_tied, dot_is in E. split; [exists v; split; assumption|].
  intros q Hq. specialize (H q Hq). rewrite scan_product_tied, dot_is in H. exact H.
Qed.
Lemma along_a_is : forall m v, @Source.along_a binary64 m v = opposite v.
Proof. intros m v. rewrite along_a_tied. reflexivity. Qed.
Lemma along_b_is : forall m v, @Source.along_b binary64 m v = fapply (transposed m) v.
Proof. intros m v. rewrite along_b_tied. reflexivity. Qed.
Lemma direction_back_is : forall m n, @Source.direction_back binary64 m n = opposite (fapply (transposed m) n).
Proof. intros m n. rewrite direction_back_tied. reflexivity. Qed.

(* 1. Runs of GJK with direction v, in SIMD lanes, on a GPU or alone: RunBounds. *)
Theorem run_contains_distance : forall P v value_a value_b size w0 w1 w2 w3 s0 s1 s2 s3,
  sound P ->
  let R_ab := @Source.frame_R binary64 (A' P) (B' P) in
  let D := @Source.frame_D binary64 (A' P) (tA P) (tB P) in
  let r := @add binary64 (r_a P) (r_b P) in
  let S := @Source.pair_scale binary64 D (rho_a P) (rho_b P) r in
  let vertex s := @Source.cso_vertex binary64 R_ab D (fst s) (snd s) in
  let w := @Source.simplex_point binary64 size w0 w1 w2 w3 (vertex s0) (vertex s1) (vertex s2) (vertex s3) in
  @Source.safely_squared binary64 < @Source.squared_norm binary64 v ->
  largest (va P) (@Source.along_a binary64 R_ab v) value_a ->
  largest (vb P) (@Source.along_b binary64 R_ab v) value_b ->
  proper P size [w0; w1; w2; w3] [s0; s1; s2; s3] ->
  contains_distance P
    (@Source.run_lower binary64 v (@Source.lanes_gap binary64 D v value_a value_b) r S 0 0)
    (@Source.run_upper binary64 w r S 0 0).
Proof.
  intros P v value_a value_b size w0 w1 w2 w3 s0 s1 s2 s3 H. cbv beta zeta. rewrite frame_is, offset_is.
  rewrite along_a_is, along_b_is, lanes_gap_is, run_lower_is, run_upper_is, pair_scale_is.
  intros Hv Ha Hb Hp. apply largest_is in Ha, Hb. apply long_enough in Hv. split.
  - intros p q Pp Pq. rewrite <- fdot_opposite, <- fnorm_opposite.
    apply (lower_holds P (opposite v) (fapply (transposed (frame P)) v)); try assumption.
    + rewrite len_opposite. exact Hv.
    + rewrite fapply_opposite, opposite_twice. reflexivity.
  - exact (upper_part P size w0 w1 w2 w3 s0 s1 s2 s3 H Hp).
Qed.

(* 2. certify_lower() along any direction n, and certify_upper(): normals of faces, and pairs that lanes leave open. *)
Theorem certify_contains_distance : forall P n value_a value_b size w0 w1 w2 w3 s0 s1 s2 s3,
  sound P ->
  let R_ab := @Source.placed_R binary64 (A' P) (B' P) in
  let D := @Source.placed_D binary64 (A' P) (tA P) (tB P) in
  let r := @Source.placed_radius binary64 (r_a P) (r_b P) in
  let S := @Source.placed_scale binary64 D (rho_a P) (rho_b P) (r_a P) (r_b P) in
  let vertex s := @Source.placed_cso_vertex binary64 R_ab D (fst s) (snd s) in
  let w := @Source.simplex_point binary64 size w0 w1 w2 w3 (vertex s0) (vertex s1) (vertex s2) (vertex s3) in
  / IZR e60 <= len n ->
  largest (va P) n value_a ->
  largest (vb P) (@Source.direction_back binary64 R_ab n) value_b ->
  proper P size [w0; w1; w2; w3] [s0; s1; s2; s3] ->
  contains_distance P
    (@Source.placed_lower binary64 (@Source.direction_gap binary64 D n value_a value_b) (@Source.norm binary64 n) r
      (@Source.placed_error binary64 (@Source.lower_units binary64) S))
    (@Source.placed_upper binary64 w r (@Source.placed_error binary64 (@Source.upper_units binary64) S)).
Proof.
  intros P n value_a value_b size w0 w1 w2 w3 s0 s1 s2 s3 H. cbv beta zeta.
  rewrite placed_R_tied, placed_D_tied, <- frame_R_tied, <- frame_D_tied, frame_is, offset_is.
  rewrite direction_back_is, direction_gap_is, placed_lower_is, placed_upper_is, placed_scale_tied, <- pair_scale_tied.
  rewrite pair_scale_is, placed_radius_tied, placed_cso_vertex_tied, <- cso_vertex_tied.
  intros Hn Ha Hb Hp. apply largest_is in Ha, Hb. split.
  - intros p q Pp Pq.
    apply (lower_holds P n (opposite (fapply (transposed (frame P)) n))); try assumption. reflexivity.
  - exact (upper_part P size w0 w1 w2 w3 s0 s1 s2 s3 H Hp).
Qed.

(* Both gaps along a run's direction are the same expression. *)
Theorem support_gap_is_lanes_gap : @Source.support_gap binary64 = @Source.lanes_gap binary64.
Proof. exact (eq_trans support_gap_tied (eq_sym lanes_gap_tied)). Qed.

(* The premises can be met: two points, two metres apart. *)
Definition identity : mat := M (V 1 0 0) (V 0 1 0) (V 0 0 1).
Example premises_can_be_met : exists P, sound P /\ part_a P (V 1 0 0) /\ part_b P (V 3 0 0).
Proof.
  assert (L : forall a : R, 0 <= a -> len (V a 0 0) = a).
  { intros a Ha. unfold len, inner. cbn [x y z]. rewrite <- (sqrt_square a Ha) at 3. f_equal. ring. }
  assert (I : rounded_rotation identity identity).
  { unfold rounded_rotation, rotation, orthogonal, row_rounded, entry, identity, transposed, inner, e90.
    cbn [x y z row0 row1 row2]. rewrite ?Rminus_0_r, ?Rabs_R0, ?Rminus_diag_eq by reflexivity. rewrite ?Rabs_R0, ?Rabs_R1.
    pose proof u_pos. repeat split; lra. }
  exists {| va := [V 1 0 0]; vb := [V 1 0 0]; rho_a := 1; rho_b := 1; r_a := 0; r_b := 0; A := identity; B := identity;
            A' := identity; B' := identity; tA := V 0 0 0; tB := V 2 0 0 |}.
  assert (H : part [V 1 0 0] 0 (V 1 0 0)).
  { exists (V 1 0 0). split; [apply hull_vertex; left; reflexivity|].
    replace (minus (V 1 0 0) (V 1 0 0)) with (V 0 0 0) by veq. rewrite L; lra. }
  split; [constructor; cbn; try lra; try exact I|split].
  - intros v [<-|[]]. rewrite L; lra.
  - intros v [<-|[]]. rewrite L; lra.
  - unfold e61. lra.
  - exists (V 1 0 0). split; [exact H|]. cbn [A B tA tB]. unfold placed, apply, identity. veq.
  - exists (V 1 0 0). split; [exact H|]. cbn [A B tA tB]. unfold placed, apply, identity. veq.
Qed.
