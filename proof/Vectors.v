(* Vectors of three reals: Cauchy-Schwarz, norms, rotations, hulls. No rounding here. *)
From Coq Require Import Reals Lra Psatz List.
From Clearance Require Import Model.
Open Scope R_scope.

Notation vec := (Model.vec R).
Notation mat := (Model.mat R).

Definition inner (a b : vec) : R := x a * x b + y a * y b + z a * z b.
Definition plus (a b : vec) : vec := V (x a + x b) (y a + y b) (z a + z b).
Definition minus (a b : vec) : vec := V (x a - x b) (y a - y b) (z a - z b).
Definition times (k : R) (a : vec) : vec := V (k * x a) (k * y a) (k * z a).
Definition len (a : vec) : R := sqrt (inner a a).
Definition zero : vec := V 0 0 0.

Ltac coords := intros; unfold inner, plus, minus, times, zero in *; cbn [x y z row0 row1 row2] in *.

Lemma vec_eq : forall a b : vec, x a = x b -> y a = y b -> z a = z b -> a = b.
Proof. intros [] []. cbn. congruence. Qed.
Ltac veq := apply vec_eq; intros; unfold inner, plus, minus, times, zero; cbn [x y z row0 row1 row2]; ring.

Lemma mat_eq : forall a b : mat, row0 a = row0 b -> row1 a = row1 b -> row2 a = row2 b -> a = b.
Proof. intros [] []. cbn. congruence. Qed.

Lemma inner_pos : forall a, 0 <= inner a a.
Proof. coords. nra. Qed.
Lemma len_pos : forall a, 0 <= len a.
Proof. intros. apply sqrt_pos. Qed.
Lemma len_sq : forall a, len a * len a = inner a a.
Proof. intros. apply sqrt_sqrt, inner_pos. Qed.
Lemma inner_comm : forall a b, inner a b = inner b a.
Proof. coords. ring. Qed.
Lemma len_0 : len zero = 0.
Proof. unfold len. replace (inner zero zero) with 0 by (coords; ring). apply sqrt_0. Qed.

Lemma square_le : forall a b, 0 <= b -> a * a <= b * b -> a <= b.
Proof. intros. apply Rnot_lt_le. intro. nra. Qed.
Lemma len_le : forall a k, 0 <= k -> inner a a <= k * k -> len a <= k.
Proof. intros. apply square_le; [assumption|]. rewrite len_sq. assumption. Qed.

Lemma cauchy : forall a b, inner a b <= len a * len b.
Proof.
  intros. apply square_le; [apply Rmult_le_pos; apply len_pos|].
  replace (len a * len b * (len a * len b)) with ((len a * len a) * (len b * len b)) by ring.
  rewrite !len_sq. coords.
  assert (H : forall p q r s : R, 0 <= (p * s - q * r) * (p * s - q * r)) by (intros; apply Rle_0_sqr).
  pose proof (H (x a) (y a) (x b) (y b)). pose proof (H (x a) (z a) (x b) (z b)).
  pose proof (H (y a) (z a) (y b) (z b)). nra.
Qed.

Lemma len_times : forall k a, len (times k a) = Rabs k * len a.
Proof.
  intros. unfold len. replace (inner (times k a) (times k a)) with (k * k * inner a a) by (coords; ring).
  rewrite sqrt_mult; [|nra|apply inner_pos]. apply Rmult_eq_compat_r. apply (sqrt_Rsqr_abs k).
Qed.

Lemma cauchy_abs : forall a b, Rabs (inner a b) <= len a * len b.
Proof.
  intros. apply Rabs_le. split; [|apply cauchy].
  pose proof (cauchy (times (-1) a) b) as H. rewrite len_times in H.
  replace (Rabs (-1)) with 1 in H by (rewrite Rabs_left; lra).
  replace (inner (times (-1) a) b) with (- inner a b) in H by (coords; ring). lra.
Qed.

Lemma triangle : forall a b, len (plus a b) <= len a + len b.
Proof.
  intros. pose proof (len_pos a). pose proof (len_pos b). apply len_le; [lra|].
  pose proof (cauchy a b). pose proof (len_sq a). pose proof (len_sq b).
  replace (inner (plus a b) (plus a b)) with (inner a a + 2 * inner a b + inner b b) by (coords; ring). nra.
Qed.

Lemma triangle_minus : forall a b, len (minus a b) <= len a + len b.
Proof.
  intros. replace (minus a b) with (plus a (times (-1) b)) by veq.
  eapply Rle_trans; [apply triangle|]. rewrite len_times.
  replace (Rabs (-1)) with 1 by (rewrite Rabs_left; lra). lra.
Qed.

Lemma len_minus_comm : forall a b, len (minus a b) = len (minus b a).
Proof. intros. unfold len. f_equal. coords. ring. Qed.

(* a is at most as far from c as from b, and b from c. *)
Lemma triangle_via : forall a b c, len (minus a c) <= len (minus a b) + len (minus b c).
Proof. intros. replace (minus a c) with (plus (minus a b) (minus b c)) by veq. apply triangle. Qed.
Lemma len_near : forall a b, len a <= len b + len (minus a b).
Proof. intros. replace a with (plus b (minus a b)) at 1 by veq. apply triangle. Qed.

Lemma abs_sq : forall a, Rabs a * Rabs a = a * a.
Proof. intros. rewrite <- Rabs_mult. apply Rabs_pos_eq. nra. Qed.

Lemma len_mono : forall a b, Rabs (x a) <= x b -> Rabs (y a) <= y b -> Rabs (z a) <= z b -> len a <= len b.
Proof.
  intros a b Hx Hy Hz. unfold len. apply sqrt_le_1_alt. coords.
  pose proof (abs_sq (x a)). pose proof (abs_sq (y a)). pose proof (abs_sq (z a)).
  pose proof (Rabs_pos (x a)). pose proof (Rabs_pos (y a)). pose proof (Rabs_pos (z a)). nra.
Qed.

(* Coordinates that err by k times those of c, and h more. *)
Lemma len_by_coordinates : forall a c k h, 0 <= k -> 0 <= h ->
  Rabs (x a) <= k * Rabs (x c) + h -> Rabs (y a) <= k * Rabs (y c) + h -> Rabs (z a) <= k * Rabs (z c) + h ->
  len a <= k * len c + 2 * h.
Proof.
  intros a c k h Hk Hh Hx Hy Hz.
  set (c' := V (Rabs (x c)) (Rabs (y c)) (Rabs (z c))).
  assert (E : len c' = len c).
  { unfold len. f_equal. unfold c'. coords. rewrite !abs_sq. reflexivity. }
  rewrite <- E.
  apply Rle_trans with (len (plus (times k c') (V h h h))).
  - apply len_mono; unfold c'; coords; assumption.
  - eapply Rle_trans; [apply triangle|]. rewrite len_times, Rabs_pos_eq by assumption.
    apply Rplus_le_compat_l. apply len_le; [lra|]. coords. nra.
Qed.

(* Products of coordinates. *)
Lemma products : forall a b, Rabs (x a * x b) + Rabs (y a * y b) + Rabs (z a * z b) <= len a * len b.
Proof.
  intros.
  set (a' := V (Rabs (x a)) (Rabs (y a)) (Rabs (z a))). set (b' := V (Rabs (x b)) (Rabs (y b)) (Rabs (z b))).
  assert (Ea : len a' = len a) by (unfold len; f_equal; unfold a'; coords; rewrite !abs_sq; reflexivity).
  assert (Eb : len b' = len b) by (unfold len; f_equal; unfold b'; coords; rewrite !abs_sq; reflexivity).
  rewrite <- Ea, <- Eb, !Rabs_mult. apply (cauchy a' b').
Qed.

(* Matrices. *)
Definition transposed (m : mat) : mat :=
  M (V (x (row0 m)) (x (row1 m)) (x (row2 m))) (V (y (row0 m)) (y (row1 m)) (y (row2 m)))
    (V (z (row0 m)) (z (row1 m)) (z (row2 m))).
Definition apply (m : mat) (v : vec) : vec := V (inner (row0 m) v) (inner (row1 m) v) (inner (row2 m) v).
Definition rows_of (f : vec -> vec) (m : mat) : mat := M (f (row0 m)) (f (row1 m)) (f (row2 m)).
(* a^T b: its rows are b^T applied to the columns of a. *)
Definition turned (a b : mat) : mat := rows_of (apply (transposed b)) (transposed a).
Definition mminus (a b : mat) : mat := M (minus (row0 a) (row0 b)) (minus (row1 a) (row1 b)) (minus (row2 a) (row2 b)).
Definition size (m : mat) : R := len (V (len (row0 m)) (len (row1 m)) (len (row2 m))).   (* Frobenius *)

Definition square_sum (m : mat) : R := inner (row0 m) (row0 m) + inner (row1 m) (row1 m) + inner (row2 m) (row2 m).
Lemma size_sq : forall m, size m * size m = square_sum m.
Proof. intros. unfold size. rewrite len_sq. unfold inner at 1. cbn [x y z]. rewrite !len_sq. reflexivity. Qed.
Lemma size_pos : forall m, 0 <= size m.
Proof. intros. apply len_pos. Qed.
Lemma size_le : forall m k, 0 <= k -> square_sum m <= k * k -> size m <= k.
Proof. intros. apply square_le; [assumption|]. rewrite size_sq. assumption. Qed.
Lemma size_transposed : forall m, size (transposed m) = size m.
Proof.
  intros. assert (square_sum (transposed m) = square_sum m) by (unfold square_sum, transposed; coords; ring).
  apply Rle_antisym; apply size_le; try apply size_pos; rewrite size_sq; lra.
Qed.

Ltac parts := unfold apply, times, plus, mminus, rows_of; cbn [x y z row0 row1 row2].

Lemma len_apply : forall m v, len (apply m v) <= size m * len v.
Proof.
  intros.
  apply Rle_trans with (len (times (len v) (V (len (row0 m)) (len (row1 m)) (len (row2 m))))).
  - apply len_mono; parts; rewrite Rmult_comm; apply cauchy_abs.
  - rewrite len_times, Rabs_pos_eq by apply len_pos. unfold size. lra.
Qed.

Lemma size_mminus_via : forall a b c, size (mminus a c) <= size (mminus a b) + size (mminus b c).
Proof.
  intros. unfold size.
  eapply Rle_trans; [|apply triangle]. apply len_mono; parts;
    rewrite Rabs_pos_eq by apply len_pos; apply triangle_via.
Qed.
Lemma size_near : forall a b, size a <= size b + size (mminus a b).
Proof.
  intros. unfold size. eapply Rle_trans; [|apply triangle].
  apply len_mono; parts; rewrite Rabs_pos_eq by apply len_pos; apply len_near.
Qed.

(* A product is at most as large as its factors' product. *)
Lemma size_turned : forall a b, size (turned a b) <= size b * size a.
Proof.
  intros. rewrite <- (size_transposed a), <- (size_transposed b). unfold turned. set (m := transposed a).
  unfold size at 1. cbn [row0 row1 row2 rows_of].
  apply Rle_trans with (len (times (size (transposed b)) (V (len (row0 m)) (len (row1 m)) (len (row2 m))))).
  - apply len_mono; parts; rewrite Rabs_pos_eq by apply len_pos; apply len_apply.
  - rewrite len_times, Rabs_pos_eq by apply size_pos. unfold size. lra.
Qed.

(* Rotations and reflections: rows of length one, at right angles to each other. *)
Definition orthogonal (m : mat) : Prop :=
  inner (row0 m) (row0 m) = 1 /\ inner (row1 m) (row1 m) = 1 /\ inner (row2 m) (row2 m) = 1 /\
  inner (row0 m) (row1 m) = 0 /\ inner (row0 m) (row2 m) = 0 /\ inner (row1 m) (row2 m) = 0.
Definition rotation (m : mat) : Prop := orthogonal m /\ orthogonal (transposed m).

Lemma transposed_twice : forall m, transposed (transposed m) = m.
Proof. intros [[] [] []]. reflexivity. Qed.
Lemma rotation_transposed : forall m, rotation m -> rotation (transposed m).
Proof. intros m [H H']. split; [assumption|]. rewrite transposed_twice. assumption. Qed.

Lemma back_and_forth : forall m v, orthogonal m -> apply m (apply (transposed m) v) = v.
Proof.
  intros [[a b c] [d e f] [g h i]] [p q r] (H1 & H2 & H3 & H4 & H5 & H6).
  unfold apply, transposed, inner in *. cbn [x y z row0 row1 row2] in *.
  f_equal.
  - transitivity ((a * a + b * b + c * c) * p + (a * d + b * e + c * f) * q + (a * g + b * h + c * i) * r); [ring|].
    rewrite H1, H4, H5. ring.
  - transitivity ((a * d + b * e + c * f) * p + (d * d + e * e + f * f) * q + (d * g + e * h + f * i) * r); [ring|].
    rewrite H2, H4, H6. ring.
  - transitivity ((a * g + b * h + c * i) * p + (d * g + e * h + f * i) * q + (g * g + h * h + i * i) * r); [ring|].
    rewrite H3, H5, H6. ring.
Qed.
Lemma adjoint : forall m v w, inner (apply m v) w = inner v (apply (transposed m) w).
Proof. intros. unfold apply, transposed. coords. ring. Qed.

Lemma len_rotated_back : forall m v, orthogonal m -> len (apply (transposed m) v) = len v.
Proof.
  intros. unfold len. f_equal. rewrite <- (transposed_twice m) at 2. rewrite adjoint, transposed_twice.
  rewrite back_and_forth by assumption. reflexivity.
Qed.
Lemma len_rotated : forall m v, rotation m -> len (apply m v) = len v.
Proof. intros m v [_ H]. rewrite <- (transposed_twice m) at 1. apply len_rotated_back. assumption. Qed.

Lemma size_rotation : forall m, orthogonal m -> size m <= 1.7320509.
Proof.
  intros m (H1 & H2 & H3 & _). apply size_le; [lra|]. unfold square_sum. rewrite H1, H2, H3. lra.
Qed.
Lemma size_turned_by : forall a b, orthogonal b -> size (turned a b) = size a.
Proof.
  intros. rewrite <- (size_transposed a). unfold size, turned. cbn [row0 row1 row2 rows_of].
  rewrite !len_rotated_back by assumption. reflexivity.
Qed.

Ltac open_all := intros; unfold turned, rows_of, apply, transposed, mminus; cbn [row0 row1 row2].
Ltac meq := open_all; apply mat_eq; cbn [row0 row1 row2]; veq.
Lemma apply_minus : forall m v w, apply m (minus v w) = minus (apply m v) (apply m w).
Proof. open_all. veq. Qed.
Lemma apply_plus : forall m v w, apply m (plus v w) = plus (apply m v) (apply m w).
Proof. open_all. veq. Qed.
Lemma apply_mminus : forall a b v, apply (mminus a b) v = minus (apply a v) (apply b v).
Proof. open_all. veq. Qed.
Lemma apply_times : forall m k v, apply m (times k v) = times k (apply m v).
Proof. open_all. veq. Qed.
Lemma apply_turned : forall a b v, apply (turned a b) v = apply (transposed a) (apply b v).
Proof. open_all. veq. Qed.
Lemma transposed_turned : forall a b, transposed (turned a b) = turned b a.
Proof. meq. Qed.
Lemma turned_mminus_l : forall a a' b, mminus (turned a b) (turned a' b) = turned (mminus a a') b.
Proof. meq. Qed.
Lemma turned_mminus_r : forall a b b', mminus (turned a b) (turned a b') = turned a (mminus b b').
Proof. meq. Qed.
Lemma mminus_transposed : forall a b, mminus (transposed a) (transposed b) = transposed (mminus a b).
Proof. reflexivity. Qed.

(* Convex hulls: the smallest convex set that holds the vertices. *)
Inductive hull (vs : list vec) : vec -> Prop :=
  | hull_vertex : forall v, In v vs -> hull vs v
  | hull_between : forall t p q, 0 <= t <= 1 -> hull vs p -> hull vs q -> hull vs (plus (times t p) (times (1 - t) q)).

Lemma hull_functional : forall vs n k, (forall v, In v vs -> inner n v <= k) -> forall p, hull vs p -> inner n p <= k.
Proof.
  intros vs n k H p Hp. induction Hp; [apply H; assumption|].
  replace (inner n (plus (times t p) (times (1 - t) q))) with (t * inner n p + (1 - t) * inner n q) by (coords; ring).
  nra.
Qed.

(* Core grown by a radius, and its placement in the world. *)
Definition part (vs : list vec) (r : R) (p : vec) : Prop := exists c, hull vs c /\ len (minus p c) <= r.
Definition placed (m : mat) (t p : vec) : vec := plus (apply m p) t.
Definition distance (p q : vec) : R := len (minus q p).

(* Rigid motions keep distances: all can be computed in the axes of a. *)
Lemma relative_frame : forall A tA B tB p q, rotation A ->
  distance (placed A tA p) (placed B tB q) =
  len (minus (plus (apply (turned A B) q) (apply (transposed A) (minus tB tA))) p).
Proof.
  intros A tA B tB p q HA. unfold distance, placed.
  rewrite <- (len_rotated_back A) by apply HA. f_equal.
  rewrite apply_turned.
  replace p with (apply (transposed A) (apply A p)) at 2.
  2: { rewrite <- (transposed_twice A) at 2. apply back_and_forth, HA. }
  rewrite <- apply_plus, <- apply_minus. f_equal. veq.
Qed.

(* A point between two others of a convex set lies in it; so does a mean of up to four with weights. *)
Lemma hull_mean2 : forall vs p q s t, 0 <= s -> 0 <= t -> 0 < s + t -> hull vs p -> hull vs q ->
  hull vs (times (/ (s + t)) (plus (times s p) (times t q))).
Proof.
  intros vs p q s t Hs Ht H Hp Hq.
  replace (times (/ (s + t)) (plus (times s p) (times t q)))
    with (plus (times (s / (s + t)) p) (times (1 - s / (s + t)) q)).
  - apply hull_between; try assumption. split.
    + apply Rmult_le_pos; [assumption|]. left. apply Rinv_0_lt_compat. assumption.
    + apply Rmult_le_reg_r with (s + t); [assumption|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra.
  - apply vec_eq; coords; field; lra.
Qed.
