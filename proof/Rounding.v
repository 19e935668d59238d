(* Rounding of the source's vector operations in binary64. *)
From Coq Require Import Reals Lra Psatz ZArith.
From Flocq Require Import Raux.
From Clearance Require Import Arithmetic Model Vectors.
Open Scope R_scope.

(* The model's operations in binary64, spelled out. *)
Definition fdot (a b : vec) : R := fl (fl (fl (x a * x b) + fl (y a * y b)) + fl (z a * z b)).
Definition fnorm (a : vec) : R := fl (sqrt (fdot a a)).
Definition fapply (m : mat) (v : vec) : vec := V (fdot (row0 m) v) (fdot (row1 m) v) (fdot (row2 m) v).
Definition fsub (a b : vec) : vec := V (fl (x a - x b)) (fl (y a - y b)) (fl (z a - z b)).
Definition fturned (m b : mat) : mat := rows_of (fapply (transposed b)) (transposed m).
Lemma dot_is : @Model.dot binary64 = fdot. Proof. reflexivity. Qed.
Lemma norm_is : @Model.norm binary64 = fnorm. Proof. reflexivity. Qed.
Lemma apply_is : @Model.mat_times binary64 = fapply. Proof. reflexivity. Qed.
Lemma sub_is : @Model.vsub binary64 = fsub. Proof. reflexivity. Qed.
Lemma turned_is : @Model.frame_R binary64 = fturned. Proof. reflexivity. Qed.

Ltac num := unfold u in *; lra.

Definition e323 := Eval vm_compute in (10 ^ 323)%Z.
Definition e161 := Eval vm_compute in (10 ^ 161)%Z.
Lemma eta_small : 0 < eta <= / IZR e323.
Proof.
  split; [apply eta_pos|]. unfold eta. apply Rinv_le_contravar; [apply IZR_lt; reflexivity|].
  apply IZR_le. vm_compute. discriminate.
Qed.

(* A rounded x where the exact value would be x'. *)
Lemma fl_near : forall a a' e m, Rabs (a - a') <= e -> Rabs a' <= m -> Rabs (fl a - a') <= u * m + (1 + u) * e + eta.
Proof.
  intros a a' e m He Hm. pose proof (fl_err a) as H. pose proof u_pos.
  assert (Rabs a <= m + e).
  { replace a with (a' + (a - a')) by ring. eapply Rle_trans; [apply Rabs_triang|]. lra. }
  replace (fl a - a') with ((fl a - a) + (a - a')) by ring. eapply Rle_trans; [apply Rabs_triang|]. nra.
Qed.
Lemma Rabs_0_le : forall a e, 0 <= e -> Rabs (a - a) <= e.
Proof. intros. replace (a - a) with 0 by ring. rewrite Rabs_R0. assumption. Qed.
Lemma Rabs_sum : forall a b a' b' e f, Rabs (a - a') <= e -> Rabs (b - b') <= f -> Rabs (a + b - (a' + b')) <= e + f.
Proof.
  intros. replace (a + b - (a' + b')) with ((a - a') + (b - b')) by ring.
  eapply Rle_trans; [apply Rabs_triang|]. lra.
Qed.
Lemma Rabs_difference : forall a b a' b' e f,
  Rabs (a - a') <= e -> Rabs (b - b') <= f -> Rabs (a - b - (a' - b')) <= e + f.
Proof.
  intros. replace (a - b - (a' - b')) with ((a - a') - (b - b')) by ring.
  eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp. lra.
Qed.
Lemma Rabs_sum_le : forall a b e f, Rabs a <= e -> Rabs b <= f -> Rabs (a + b) <= e + f.
Proof. intros. eapply Rle_trans; [apply Rabs_triang|]. lra. Qed.
Lemma Rabs_sub_le : forall a b e f, Rabs a <= e -> Rabs b <= f -> Rabs (a - b) <= e + f.
Proof. intros. eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp. lra. Qed.

(* The dot product. *)
Definition c3 := 3.000001 * u.
Lemma fdot_err : forall a b, Rabs (fdot a b - inner a b) <= c3 * (len a * len b) + 7 * eta.
Proof.
  intros a b. unfold fdot, inner. pose proof (products a b) as P.
  set (p := x a * x b) in *. set (q := y a * y b) in *. set (r := z a * z b) in *.
  pose proof (fl_err p) as Hp. pose proof (fl_err q) as Hq. pose proof (fl_err r) as Hr.
  pose proof (fl_near (fl p + fl q) (p + q) _ _ (Rabs_sum _ _ _ _ _ _ Hp Hq)
    (Rabs_sum_le p q _ _ (Rle_refl _) (Rle_refl _))) as Hs.
  pose proof (fl_near (fl (fl p + fl q) + fl r) (p + q + r) _ _ (Rabs_sum _ _ _ _ _ _ Hs Hr)
    (Rabs_sum_le _ r _ _ (Rabs_sum_le p q _ _ (Rle_refl _) (Rle_refl _)) (Rle_refl _))) as Ht.
  eapply Rle_trans; [exact Ht|]. clear Ht Hs Hp Hq Hr.
  pose proof eta_pos. pose proof (Rabs_pos p). pose proof (Rabs_pos q). pose proof (Rabs_pos r). unfold c3. num.
Qed.

(* The length. h covers underflow of the squares. *)
Definition h := / IZR e161.
Lemma h_eta : 7 * eta <= h * h.
Proof. pose proof eta_small. unfold h, e161, e323 in *. lra. Qed.
Lemma h_pos : 0 < h.
Proof. unfold h, e161. lra. Qed.
Lemma eta_le_h : 2 * eta <= h.
Proof. pose proof eta_small. unfold h, e161, e323 in *. lra. Qed.

Lemma fnorm_err : forall a, len a * (1 - 2.52 * u) - 2 * h <= fnorm a <= len a * (1 + 2.52 * u) + 2 * h.
Proof.
  intros a. unfold fnorm.
  pose proof (fdot_err a a) as H. rewrite <- len_sq in H. pose proof (len_pos a) as N.
  set (n := len a) in *. set (s := fdot a a) in *. pose proof h_eta as E. pose proof h_pos as Hh. pose proof eta_le_h as Heh.
  pose proof eta_pos. apply Rabs_le_inv in H. unfold c3 in H. destruct H as [Hlow Hhigh].
  assert (Hn : 0 <= n * n) by nra.
  assert (L : n * (1 - 1.51 * u) - h <= sqrt s).
  { destruct (Rle_lt_dec (n * (1 - 1.51 * u) - h) 0) as [K|K]; [eapply Rle_trans; [exact K|apply sqrt_pos]|].
    assert (B : (n * (1 - 1.51 * u) - h) * (n * (1 - 1.51 * u) - h) <= n * n * (1 - 3.01 * u) - h * h).
    { assert (n * n * ((1 - 1.51 * u) * (1 - 1.51 * u)) <= n * n * (1 - 3.01 * u)).
      { apply Rmult_le_compat_l; [assumption|]. num. }
      set (k := n * (1 - 1.51 * u)) in *.
      replace (n * n * ((1 - 1.51 * u) * (1 - 1.51 * u))) with (k * k) in * by (unfold k; ring).
      assert (0 <= h * (k - h)) by (apply Rmult_le_pos; lra). nra. }
    rewrite <- (sqrt_square (n * (1 - 1.51 * u) - h)) by lra. apply sqrt_le_1_alt.
    eapply Rle_trans; [exact B|]. num. }
  assert (U : sqrt s <= n * (1 + 1.51 * u) + h).
  { assert (K : 0 <= n * (1 + 1.51 * u) + h) by (pose proof u_pos; nra).
    rewrite <- (sqrt_square (n * (1 + 1.51 * u) + h)) by assumption. apply sqrt_le_1_alt.
    assert (n * n * (1 + 3.01 * u) <= n * n * ((1 + 1.51 * u) * (1 + 1.51 * u))).
    { apply Rmult_le_compat_l; [assumption|]. num. }
    assert (0 <= n * (1 + 1.51 * u) * h) by (pose proof u_pos; apply Rmult_le_pos; nra).
    replace ((n * (1 + 1.51 * u) + h) * (n * (1 + 1.51 * u) + h))
      with (n * n * ((1 + 1.51 * u) * (1 + 1.51 * u)) + 2 * (n * (1 + 1.51 * u) * h) + h * h) by ring.
    num. }
  pose proof (fl_err (sqrt s)) as F. pose proof (sqrt_pos s). rewrite (Rabs_pos_eq (sqrt s)) in F by assumption.
  apply Rabs_le_inv in F. split; num.
Qed.
Lemma fnorm_pos : forall a, 0 <= fnorm a.
Proof. intros. apply fl_pos, sqrt_pos. Qed.

(* A matrix times a vector. *)
Lemma fapply_err : forall m v, len (minus (fapply m v) (apply m v)) <= c3 * (size m * len v) + 14 * eta.
Proof.
  intros m v. pose proof eta_pos. pose proof (len_pos v). pose proof u_pos.
  assert (Hc : 0 <= c3) by (unfold c3; lra).
  pose proof (len_by_coordinates (minus (fapply m v) (apply m v))
    (times (len v) (V (len (row0 m)) (len (row1 m)) (len (row2 m)))) c3 (7 * eta) Hc) as H'.
  rewrite len_times, (Rabs_pos_eq (len v)) in H' by assumption. fold (size m) in H'.
  eapply Rle_trans; [apply H'; clear H'; try lra|lra].
  all: unfold minus, fapply, apply, times; cbn [x y z]; rewrite (Rabs_pos_eq (len v * _)) by (apply Rmult_le_pos; apply len_pos);
    eapply Rle_trans; [apply fdot_err|]; rewrite (Rmult_comm (len v)); apply Rle_refl.
Qed.

(* A matrix close to an exact one, times a vector. *)
Lemma fapply_near : forall m' m e s v, size (mminus m' m) <= e -> size m' <= s ->
  len (minus (fapply m' v) (apply m v)) <= (c3 * s + e) * len v + 14 * eta.
Proof.
  intros m' m e s v He Hs. eapply Rle_trans; [apply (triangle_via _ (apply m' v))|].
  rewrite <- apply_mminus. pose proof (fapply_err m' v). pose proof (len_apply (mminus m' m) v).
  pose proof (len_pos v). assert (Hc : 0 <= c3) by (unfold c3; pose proof u_pos; lra).
  assert (size m' * len v <= s * len v) by nra. assert (size (mminus m' m) * len v <= e * len v) by nra. nra.
Qed.

(* The product of two matrices, one of them transposed. *)
Lemma fturned_err : forall m b, size (mminus (fturned m b) (turned m b)) <= c3 * (size b * size m) + 28 * eta.
Proof.
  intros m b. pose proof eta_pos. pose proof (size_pos b). pose proof u_pos.
  assert (Hc : 0 <= c3) by (unfold c3; lra).
  rewrite <- (size_transposed m), <- (size_transposed b).
  set (mt := transposed m). set (bt := transposed b) in *.
  pose proof (len_by_coordinates
    (V (len (row0 (mminus (fturned m b) (turned m b)))) (len (row1 (mminus (fturned m b) (turned m b))))
       (len (row2 (mminus (fturned m b) (turned m b)))))
    (times (size bt) (V (len (row0 mt)) (len (row1 mt)) (len (row2 mt)))) c3 (14 * eta) Hc) as H'.
  rewrite len_times, (Rabs_pos_eq (size bt)) in H' by apply size_pos. fold (size mt) in H'.
  unfold size at 1. eapply Rle_trans; [apply H'; clear H'; try lra|lra].
  all: unfold times; cbn [x y z]; rewrite (Rabs_pos_eq (len _)) by apply len_pos;
    rewrite (Rabs_pos_eq (size bt * _)) by (apply Rmult_le_pos; [apply size_pos|apply len_pos]);
    apply fapply_err.
Qed.

(* Rotations as engine/pose/pose.h returns them: each entry is rounded once from about 100 bits. *)
Definition e90 := Eval vm_compute in (2 ^ 90)%Z.
Definition entry (a' a : R) : Prop := Rabs (a' - a) <= u * Rabs a + / IZR e90.
Definition row_rounded (a' a : vec) : Prop := entry (x a') (x a) /\ entry (y a') (y a) /\ entry (z a') (z a).
Definition rounded_rotation (m' m : mat) : Prop :=
  rotation m /\ row_rounded (row0 m') (row0 m) /\ row_rounded (row1 m') (row1 m) /\ row_rounded (row2 m') (row2 m).

Lemma row_err : forall a' a, row_rounded a' a -> len (minus a' a) <= u * len a + 2 * / IZR e90.
Proof.
  intros a' a (Hx & Hy & Hz). apply len_by_coordinates; try assumption; [left; apply u_pos|unfold e90; lra].
Qed.
Lemma rotation_err : forall m' m, rounded_rotation m' m -> size (mminus m' m) <= 1.732051 * u.
Proof.
  intros m' m (Hm & H0 & H1 & H2). apply row_err in H0, H1, H2.
  pose proof (size_rotation m (proj1 Hm)) as S.
  apply Rle_trans with (u * size m + 2 * (2 * / IZR e90)).
  - apply (len_by_coordinates _ (V (len (row0 m)) (len (row1 m)) (len (row2 m)))); cbn [x y z row0 row1 row2 mminus];
      try (unfold u, e90; lra); rewrite !Rabs_pos_eq by apply len_pos; assumption.
  - unfold e90. num.
Qed.
Lemma rotation_size : forall m' m, rounded_rotation m' m -> size m' <= 1.732051.
Proof.
  intros m' m H. pose proof (size_near m' m). pose proof (rotation_err _ _ H).
  pose proof (size_rotation m (proj1 (proj1 H))). num.
Qed.

(* The relative rotation, docs/trust/bounds.md: 9 + 2 sqrt 3. *)
Lemma relative_err : forall A' A B' B, rounded_rotation A' A -> rounded_rotation B' B ->
  size (mminus (fturned A' B') (turned A B)) <= 12.4642 * u.
Proof.
  intros A' A B' B HA HB.
  pose proof (rotation_err _ _ HA) as eA. pose proof (rotation_err _ _ HB) as eB.
  pose proof (rotation_size _ _ HA) as sA. pose proof (rotation_size _ _ HB) as sB.
  assert (H1 : size (mminus (fturned A' B') (turned A' B')) <= 9.000006 * u).
  { eapply Rle_trans; [apply fturned_err|]. pose proof (size_pos A'). pose proof (size_pos B').
    assert (size B' * size A' <= 1.732051 * 1.732051) by (apply Rmult_le_compat; assumption).
    pose proof eta_small. unfold c3, e323, u in *. lra. }
  assert (H2 : size (mminus (turned A' B') (turned A B')) <= 1.732051 * u + 1.732051 * u * (1.732051 * u)).
  { rewrite turned_mminus_l. eapply Rle_trans; [apply (size_near _ (turned (mminus A' A) B))|].
    rewrite turned_mminus_r. rewrite size_turned_by by apply (proj1 HB).
    apply Rplus_le_compat; [assumption|]. eapply Rle_trans; [apply size_turned|].
    apply Rmult_le_compat; try apply size_pos; assumption. }
  assert (H3 : size (mminus (turned A B') (turned A B)) <= 1.732051 * u).
  { rewrite turned_mminus_r, <- size_transposed, transposed_turned, size_turned_by by apply (proj1 HA). assumption. }
  pose proof (size_mminus_via (fturned A' B') (turned A' B') (turned A B)).
  pose proof (size_mminus_via (turned A' B') (turned A B') (turned A B)). num.
Qed.
Lemma rotation_turned : forall A B, rotation A -> rotation B -> rotation (turned A B).
Proof.
  assert (K : forall A B, rotation A -> rotation B -> orthogonal (turned A B)).
  { intros A B [HA HA'] [HB HB'].
    assert (P : forall v w, inner (apply (transposed B) v) (apply (transposed B) w) = inner v w).
    { intros. rewrite adjoint, transposed_twice, back_and_forth by assumption. reflexivity. }
    unfold orthogonal, turned, rows_of. cbn [row0 row1 row2]. rewrite !P. exact HA'. }
  intros A B HA HB. split; [apply K; assumption|]. rewrite transposed_turned. apply K; assumption.
Qed.
Lemma relative_size : forall A' A B' B, rounded_rotation A' A -> rounded_rotation B' B ->
  size (fturned A' B') <= 1.732051.
Proof.
  intros A' A B' B HA HB. pose proof (size_near (fturned A' B') (turned A B)).
  pose proof (relative_err _ _ _ _ HA HB).
  pose proof (size_rotation (turned A B) (proj1 (rotation_turned A B (proj1 HA) (proj1 HB)))). num.
Qed.

(* Turning a vertex of b, or a direction back: docs/trust/bounds.md, (2). *)
Definition kTurn := 17.6605 * u.
Lemma turn_err : forall A' A B' B v, rounded_rotation A' A -> rounded_rotation B' B ->
  len (minus (fapply (fturned A' B') v) (apply (turned A B) v)) <= kTurn * len v + 14 * eta.
Proof.
  intros A' A B' B v HA HB. pose proof (len_pos v).
  eapply Rle_trans; [apply fapply_near; [apply (relative_err _ _ _ _ HA HB)|apply (relative_size _ _ _ _ HA HB)]|].
  apply Rplus_le_compat_r, Rmult_le_compat_r; [assumption|]. unfold c3, kTurn. num.
Qed.
Lemma turn_back_err : forall A' A B' B v, rounded_rotation A' A -> rounded_rotation B' B ->
  len (minus (fapply (transposed (fturned A' B')) v) (apply (transposed (turned A B)) v)) <= kTurn * len v + 14 * eta.
Proof.
  intros A' A B' B v HA HB. pose proof (len_pos v).
  eapply Rle_trans; [apply fapply_near; [|rewrite size_transposed; apply (relative_size _ _ _ _ HA HB)]|].
  - rewrite mminus_transposed, size_transposed. apply (relative_err _ _ _ _ HA HB).
  - apply Rplus_le_compat_r, Rmult_le_compat_r; [assumption|]. unfold c3, kTurn. num.
Qed.

(* The offset of b, in the axes of a. *)
Lemma fsub_err : forall a b, len (minus (fsub a b) (minus a b)) <= u * len (minus a b) + 2 * eta.
Proof. intros. pose proof eta_pos. apply len_by_coordinates; try (left; apply u_pos); try lra; apply fl_err. Qed.
Definition kOffset := 7.9283 * u.
Lemma offset_err : forall A' A tA tB, rounded_rotation A' A ->
  len (minus (fapply (transposed A') (fsub tB tA)) (apply (transposed A) (minus tB tA)))
  <= kOffset * len (minus tB tA) + 17 * eta.
Proof.
  intros A' A tA tB HA. pose proof (fsub_err tB tA) as H. set (t' := fsub tB tA) in *. set (t := minus tB tA) in *.
  eapply Rle_trans; [apply (triangle_via _ (apply (transposed A) t'))|].
  rewrite <- apply_minus, len_rotated_back by apply (proj1 HA).
  pose proof (fapply_near (transposed A') (transposed A) (1.732051 * u) 1.732051 t') as F.
  rewrite mminus_transposed, !size_transposed in F.
  specialize (F (rotation_err _ _ HA) (rotation_size _ _ HA)).
  pose proof (len_near t' t). pose proof (len_pos t). pose proof eta_pos. unfold c3, kOffset in *. num.
Qed.
