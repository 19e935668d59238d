(* The point of the Minkowski difference that vertices and weights give, as computed and exact. *)
From Coq Require Import Reals Lra Psatz ZArith List.
From Flocq Require Import Raux.
From Clearance Require Import Arithmetic Model Vectors Rounding Bounds Lower.
Open Scope R_scope.

(* What the source computes, spelled out. *)
Definition fcso (R' : mat) (D' a b : vec) : vec := fsub (fsub a (fapply R' b)) D'.
Definition fadd_scaled (w v : vec) (s : R) : vec :=
  V (fl (x w + fl (x v * s))) (fl (y w + fl (y v * s))) (fl (z w + fl (z v * s))).
Definition positive (w : R) : R := if Rlt_dec 0 w then w else 0.
Fixpoint fsum (ws : list R) (sum : R) : R :=
  match ws with nil => sum | w :: rest => fsum rest (fl (sum + positive w)) end.
Definition or_one (total e : R) : R := if Rlt_dec 0 total then e else 1.
Fixpoint fweighted (ss : list R) (vs : list vec) (sum : R) (w : vec) : vec :=
  match ss, vs with
  | s :: rest, v :: more => fweighted rest more sum (fadd_scaled w v (fl (s / sum)))
  | _, _ => w
  end.
Definition fshares (ws : list R) : list R :=
  match map positive ws with nil => nil | s :: rest => or_one (fsum ws 0) s :: rest end.
Definition fpoint (ws : list R) (vs : list vec) : vec :=
  fweighted (fshares ws) vs (or_one (fsum ws 0) (fsum ws 0)) zero.
Lemma cso_is : @Model.cso_vertex binary64 = fcso. Proof. reflexivity. Qed.

(* Sums of the weights. *)
Definition total (ws : list R) : R := fold_right (fun w s => positive w + s) 0 ws.
Lemma positive_pos : forall w, 0 <= positive w.
Proof. intros. unfold positive. destruct (Rlt_dec 0 w); lra. Qed.
Lemma positive_float : forall w, float w -> float (positive w).
Proof. intros. unfold positive. destruct (Rlt_dec 0 w); [assumption|apply float_0]. Qed.
Lemma total_pos : forall ws, 0 <= total ws.
Proof. unfold total. induction ws; cbn [fold_right]; [lra|]. pose proof (positive_pos a). lra. Qed.

Lemma fsum_err : forall ws acc, float acc -> 0 <= acc -> Forall float ws ->
  (acc + total ws) * (1 - u) ^ length ws <= fsum ws acc <= (acc + total ws) * (1 + u) ^ length ws.
Proof.
  induction ws as [|w ws IH]; intros acc Fa Ha Fw; cbn [fsum total fold_right length pow].
  - unfold total. cbn [fold_right]. lra.
  - inversion Fw as [|? ? F1 F2]; subst. pose proof (positive_pos w) as Hp.
    pose proof (fl_sum acc (positive w) Fa (positive_float w F1) Ha Hp) as [L U].
    pose proof (total_pos ws) as Ht. fold (total ws). pose proof u_pos as Hu.
    assert (U1 : 0 <= (1 - u) ^ length ws) by (apply pow_le; num).
    assert (U2 : 0 <= (1 + u) ^ length ws) by (apply pow_le; num).
    destruct (IH (fl (acc + positive w)) (fl_format _) ltac:(apply fl_pos; lra) F2) as [IL IU].
    split.
    + eapply Rle_trans; [|exact IL]. rewrite <- Rmult_assoc. apply Rmult_le_compat_r; [assumption|]. nra.
    + eapply Rle_trans; [exact IU|]. rewrite <- Rmult_assoc. apply Rmult_le_compat_r; [assumption|]. nra.
Qed.

Lemma powers : forall n, (n <= 3)%nat -> 1 - 3.01 * u <= (1 - u) ^ n /\ (1 + u) ^ n <= 1 + 3.01 * u.
Proof.
  intros n H. assert (n = 0 \/ n = 1 \/ n = 2 \/ n = 3)%nat as [-> | [-> | [-> | ->]]] by lia; cbn [pow]; split; num.
Qed.

(* Shares before the division, and their divisor: up to 3 sums, so 3 u. *)
Definition sum_of (ss : list R) : R := fold_right Rplus 0 ss.
Lemma sum_positive : forall ws, sum_of (map positive ws) = total ws.
Proof. unfold sum_of, total. induction ws; cbn [map fold_right]; [reflexivity|]. rewrite IHws. reflexivity. Qed.

Lemma shares_sum : forall ws, (1 <= length ws <= 4)%nat -> Forall float ws ->
  let div := or_one (fsum ws 0) (fsum ws 0) in
  0 < div /\ Forall (Rle 0) (fshares ws) /\ Rabs (sum_of (fshares ws) / div - 1) <= 3.02 * u.
Proof.
  intros ws Hl Fw div. destruct ws as [|w ws]; [cbn in Hl; lia|].
  inversion Fw as [|? ? F1 F2]; subst. cbn [length] in Hl.
  pose proof (positive_pos w) as Hp. pose proof (total_pos ws) as Ht.
  assert (E : fsum (w :: ws) 0 = fsum ws (positive w)).
  { cbn [fsum]. rewrite Rplus_0_l, fl_exact by (apply positive_float; assumption). reflexivity. }
  pose proof (fsum_err ws (positive w) (positive_float w F1) Hp F2) as [L U].
  destruct (powers (length ws) ltac:(lia)) as [P1 P2].
  assert (NN : Forall (Rle 0) (map positive ws)).
  { apply Forall_forall. intros q Hq. apply in_map_iff in Hq. destruct Hq as (v & <- & _). apply positive_pos. }
  unfold div, fshares. cbn [map]. rewrite E. set (T := positive w + total ws) in *.
  set (f := fsum ws (positive w)) in *. unfold or_one. destruct (Rlt_dec 0 f) as [Hf|Hf].
  - split; [assumption|]. split; [constructor; assumption|].
    cbn [sum_of fold_right]. fold (sum_of (map positive ws)). rewrite sum_positive. fold T.
    assert (B : T * (1 - 3.01 * u) <= f <= T * (1 + 3.01 * u)) by
      (split; [eapply Rle_trans; [|exact L]|eapply Rle_trans; [exact U|]]; apply Rmult_le_compat_l; assumption || (unfold T; lra)).
    replace (T / f - 1) with ((T - f) / f) by (field; lra).
    unfold Rdiv. rewrite Rabs_mult, (Rabs_pos_eq (/ f)) by (left; apply Rinv_0_lt_compat; assumption).
    apply Rmult_le_reg_r with f; [assumption|]. rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra.
    apply Rabs_le. unfold u in *. lra.
  - split; [lra|]. split; [constructor; [lra|assumption]|].
    cbn [sum_of fold_right]. fold (sum_of (map positive ws)). rewrite sum_positive.
    assert (0 < (1 - u) ^ length ws) by (eapply Rlt_le_trans; [|exact P1]; num).
    assert (T <= 0).
    { apply Rnot_lt_le. intro. apply Hf. eapply Rlt_le_trans; [|exact L]. apply Rmult_lt_0_compat; assumption. }
    assert (total ws = 0) as -> by (unfold T in *; lra).
    replace ((1 + 0) / 1 - 1) with 0 by field. rewrite Rabs_R0. num.
Qed.

(* The shares as divided: one division more, so 4 u. *)
Definition divided (div : R) (ss : list R) : list R := map (fun s => fl (s / div)) ss.
Lemma divided_sum : forall div ss, 0 < div -> Forall (Rle 0) ss ->
  Forall (Rle 0) (divided div ss) /\
  Rabs (sum_of (divided div ss) - sum_of ss / div) <= u * (sum_of ss / div) + INR (length ss) * eta.
Proof.
  intros div ss Hd H. assert (Hi : 0 < / div) by (apply Rinv_0_lt_compat; assumption).
  induction H as [|s ss Hs H [IH1 IH2]]; cbn [divided map sum_of fold_right length]; split.
  - constructor.
  - cbn [INR]. unfold Rdiv. rewrite Rmult_0_l, Rminus_0_r, Rabs_R0. lra.
  - constructor; [|assumption]. apply fl_pos. apply Rmult_le_pos; lra.
  - fold (divided div ss) (sum_of (divided div ss)) (sum_of ss). rewrite S_INR.
    pose proof (fl_err (s / div)) as E. rewrite (Rabs_pos_eq (s / div)) in E by (apply Rmult_le_pos; lra).
    replace ((s + sum_of ss) / div) with (s / div + sum_of ss / div) by (field; lra).
    replace (fl (s / div) + sum_of (divided div ss) - (s / div + sum_of ss / div))
      with ((fl (s / div) - s / div) + (sum_of (divided div ss) - sum_of ss / div)) by ring.
    eapply Rle_trans; [apply Rabs_triang|]. lra.
Qed.
Lemma length_shares : forall ws, length (fshares ws) = length ws.
Proof. intros [|w ws]; [reflexivity|]. unfold fshares. cbn. rewrite map_length. reflexivity. Qed.

(* A vertex of the Minkowski difference. *)
Definition cso (R : mat) (D a b : vec) : vec := minus (minus a (apply R b)) D.
Lemma vertex_err : forall A' A B' B D' D a b rho_a rho_b,
  rounded_rotation A' A -> rounded_rotation B' B -> len (minus D' D) <= kOffset * len D + 17 * eta ->
  len a <= rho_a -> len b <= rho_b ->
  len (minus (fcso (fturned A' B') D' a b) (cso (turned A B) D a b)) <=
    19.67 * u * (len D + rho_a + rho_b) + 40 * eta /\
  len (fcso (fturned A' B') D' a b) <= (1 + 20 * u) * (len D + rho_a + rho_b) + 40 * eta.
Proof.
  intros A' A B' B D' D a b ra rb HA HB HD Ha Hb.
  pose proof (turn_err _ _ _ _ b HA HB) as T. set (Rb' := fapply (fturned A' B') b) in *.
  set (Rb := apply (turned A B) b) in *.
  assert (LR : len Rb = len b) by (apply len_rotated, rotation_turned; [apply (proj1 HA)|apply (proj1 HB)]).
  pose proof (len_near Rb' Rb) as L1. unfold fcso, cso. fold Rb' Rb.
  pose proof (fsub_err a Rb') as E1. pose proof (triangle_minus a Rb') as L2. set (s' := fsub a Rb') in *.
  pose proof (fsub_err s' D') as E2. pose proof (triangle_minus s' D') as L3. pose proof (len_near s' (minus a Rb')) as L4.
  pose proof (len_near D' D) as L5. set (w' := fsub s' D') in *. set (w := minus (minus a Rb) D).
  assert (V1 : len (minus (minus a Rb') (minus a Rb)) <= len (minus Rb' Rb)).
  { replace (minus (minus a Rb') (minus a Rb)) with (times (-1) (minus Rb' Rb)) by veq.
    rewrite len_times. replace (Rabs (-1)) with 1 by (rewrite Rabs_left; lra). lra. }
  assert (V2 : len (minus (minus s' D') w) <= len (minus s' (minus a Rb)) + len (minus D' D)).
  { replace (minus (minus s' D') w) with (minus (minus s' (minus a Rb)) (minus D' D)) by (unfold w; veq).
    apply triangle_minus. }
  pose proof (triangle_via s' (minus a Rb') (minus a Rb)) as V3.
  pose proof (triangle_via w' (minus s' D') w) as V4.
  pose proof (len_near w' w) as V5. pose proof (triangle_minus (minus a Rb) D) as V6.
  pose proof (triangle_minus a Rb) as V7. fold w in V6.
  pose proof (len_pos a). pose proof (len_pos b). pose proof (len_pos D). pose proof eta_pos.
  unfold kTurn, kOffset in *. clearbody w. split; unfold u in *; lra.
Qed.

(* Sums of products, coordinate by coordinate: n operations deep. *)
Definition kDeep (n : R) := n * (1.000001 * u).
Definition deep1 (n acc ex ab : R) : Prop := Rabs (acc - ex) <= kDeep n * ab + n * (4 * eta) /\ Rabs ex <= ab.
Definition deep (n : R) (acc ex ab : vec) : Prop :=
  deep1 n (x acc) (x ex) (x ab) /\ deep1 n (y acc) (y ex) (y ab) /\ deep1 n (z acc) (z ex) (z ab).
Definition sizes (v : vec) : vec := V (Rabs (x v)) (Rabs (y v)) (Rabs (z v)).
Lemma len_sizes : forall v, len (sizes v) = len v.
Proof. intros. unfold len. f_equal. unfold sizes. coords. rewrite !abs_sq. reflexivity. Qed.

Lemma deep1_first : forall v s, 0 <= s -> deep1 1 (fl (0 + fl (v * s))) (s * v) (s * Rabs v).
Proof.
  intros v s Hs. rewrite Rplus_0_l, fl_exact by apply fl_format.
  pose proof (fl_err (v * s)) as E. rewrite Rabs_mult, (Rabs_pos_eq s) in E by assumption.
  split; [|rewrite Rabs_mult, (Rabs_pos_eq s) by assumption; lra].
  rewrite (Rmult_comm s v). eapply Rle_trans; [exact E|]. unfold kDeep.
  pose proof (Rabs_pos v). pose proof eta_pos. assert (0 <= Rabs v * s) by (apply Rmult_le_pos; lra). num.
Qed.
Lemma deep1_step : forall n acc ex ab v s, 1 <= n <= 3 -> 0 <= s -> deep1 n acc ex ab ->
  deep1 (n + 1) (fl (acc + fl (v * s))) (ex + s * v) (ab + s * Rabs v).
Proof.
  intros n acc ex ab v s Hn Hs [H1 H2]. pose proof (fl_err (v * s)) as E.
  rewrite (Rmult_comm v s) in E at 2 3. rewrite Rabs_mult, (Rabs_pos_eq s) in E by assumption.
  assert (Hv : Rabs (s * v) <= s * Rabs v) by (rewrite Rabs_mult, (Rabs_pos_eq s) by assumption; lra).
  pose proof (fl_near (acc + fl (v * s)) (ex + s * v) _ _ (Rabs_sum _ _ _ _ _ _ H1 E) (Rabs_sum_le _ _ _ _ H2 Hv)) as F.
  split; [|eapply Rle_trans; [apply Rabs_triang|]; lra].
  eapply Rle_trans; [exact F|]. clear F E H1. pose proof (Rabs_pos ex). pose proof eta_pos.
  assert (0 <= s * Rabs v) by (apply Rmult_le_pos; [assumption|apply Rabs_pos]).
  set (p := s * Rabs v) in *. assert (0 <= ab) by lra. unfold kDeep.
  assert (n * ab <= 3 * ab) by (apply Rmult_le_compat_r; lra). assert (ab <= n * ab) by nra.
  assert (p <= n * p <= 3 * p) by (split; nra). assert (n * eta <= 3 * eta) by nra.
  set (q := n * ab) in *. set (r := n * p) in *. set (e := n * eta) in *.
  replace (n * (1.000001 * u) * ab) with (1.000001 * u * q) by (unfold q; ring).
  replace ((n + 1) * (1.000001 * u) * (ab + p)) with (1.000001 * u * (q + r + ab + p)) by (unfold q, r; ring).
  replace (n * (4 * eta)) with (4 * e) by (unfold e; ring).
  replace ((n + 1) * (4 * eta)) with (4 * e + 4 * eta) by (unfold e; ring).
  num.
Qed.

(* The run over the vertices: exact sums of shares, of vertices of a and of b, next to the computed point. *)
Definition sums (va vb : list vec) (W ew : R) (R0 : mat) (D : vec) (n L : R) (acc : vec) : Prop :=
  exists ex ab ca cb : vec,
    0 <= L /\ deep n acc ex ab /\ len ab <= L * W /\ len (minus ex (times L (cso R0 D ca cb))) <= L * ew /\
    hull va ca /\ hull vb cb.

Lemma sums_first : forall va vb W ew R0 D a b v s, 0 <= s -> In a va -> In b vb ->
  len v <= W -> len (minus v (cso R0 D a b)) <= ew ->
  sums va vb W ew R0 D 1 s (fadd_scaled zero v s).
Proof.
  intros va vb W ew R0 D a b v s Hs Ha Hb HW He. exists (times s v), (times s (sizes v)), a, b.
  split; [assumption|]. split.
  { unfold deep, fadd_scaled, times, sizes, zero. cbn [x y z]. split; [|split]; apply deep1_first; assumption. }
  split; [rewrite len_times, len_sizes, Rabs_pos_eq by assumption; apply Rmult_le_compat_l; assumption|].
  split; [|split; apply hull_vertex; assumption].
  replace (minus (times s v) (times s (cso R0 D a b))) with (times s (minus v (cso R0 D a b))) by veq.
  rewrite len_times, Rabs_pos_eq by assumption. apply Rmult_le_compat_l; assumption.
Qed.

(* The mean of two points of a hull. *)
Lemma mean : forall vs L s p q, 0 <= L -> 0 <= s -> hull vs p -> hull vs q ->
  exists r, hull vs r /\ plus (times L p) (times s q) = times (L + s) r.
Proof.
  intros vs L s p q HL Hs Hp Hq. destruct (Rle_lt_dec (L + s) 0) as [H|H].
  - exists p. split; [assumption|]. assert (L = 0) as -> by lra. assert (s = 0) as -> by lra. veq.
  - exists (times (/ (L + s)) (plus (times L p) (times s q))). split; [apply hull_mean2; assumption|].
    apply vec_eq; coords; field; lra.
Qed.
Lemma two_means : forall va vb L s pa qa pb qb, 0 <= L -> 0 <= s -> hull va pa -> hull va qa -> hull vb pb -> hull vb qb ->
  exists ra rb, hull va ra /\ hull vb rb /\ forall R0 D,
    plus (times L (cso R0 D pa pb)) (times s (cso R0 D qa qb)) = times (L + s) (cso R0 D ra rb).
Proof.
  intros va vb L s pa qa pb qb HL Hs Ha Ha' Hb Hb'.
  destruct (mean va L s pa qa HL Hs Ha Ha') as (ra & Hra & Ea). destruct (mean vb L s pb qb HL Hs Hb Hb') as (rb & Hrb & Eb).
  exists ra, rb. split; [assumption|]. split; [assumption|]. intros R0 D. unfold cso.
  replace (times (L + s) (minus (minus ra (apply R0 rb)) D))
    with (minus (minus (times (L + s) ra) (apply R0 (times (L + s) rb))) (times (L + s) D)) by (rewrite apply_times; veq).
  rewrite <- Ea, <- Eb, apply_plus, !apply_times. veq.
Qed.

Lemma sums_step : forall va vb W ew R0 D n L acc a b v s, 1 <= n <= 3 -> 0 <= s -> In a va -> In b vb ->
  len v <= W -> len (minus v (cso R0 D a b)) <= ew ->
  sums va vb W ew R0 D n L acc -> sums va vb W ew R0 D (n + 1) (L + s) (fadd_scaled acc v s).
Proof.
  intros va vb W ew R0 D n L acc a b v s Hn Hs Ha Hb HW He (ex & ab & ca & cb & HL & (D1 & D2 & D3) & HB & HE & Hca & Hcb).
  destruct (two_means va vb L s ca a cb b HL Hs Hca (hull_vertex _ _ Ha) Hcb (hull_vertex _ _ Hb)) as (ra & rb & Hra & Hrb & E).
  exists (plus ex (times s v)), (plus ab (times s (sizes v))), ra, rb.
  split; [lra|]. split.
  { unfold deep, fadd_scaled, plus, times, sizes. cbn [x y z]. split; [|split]; apply deep1_step; assumption. }
  split.
  { eapply Rle_trans; [apply triangle|]. rewrite len_times, len_sizes, Rabs_pos_eq by assumption.
    assert (s * len v <= s * W) by (apply Rmult_le_compat_l; assumption). lra. }
  split; [|split; assumption]. rewrite <- E.
  replace (minus (plus ex (times s v)) (plus (times L (cso R0 D ca cb)) (times s (cso R0 D a b))))
    with (plus (minus ex (times L (cso R0 D ca cb))) (times s (minus v (cso R0 D a b)))) by veq.
  eapply Rle_trans; [apply triangle|]. rewrite len_times, Rabs_pos_eq by assumption.
  assert (s * len (minus v (cso R0 D a b)) <= s * ew) by (apply Rmult_le_compat_l; assumption). lra.
Qed.

(* All vertices: pairs of vertices of a and b, and the computed difference of each. *)
Definition vertices_of (va vb : list vec) (W ew : R) (R0 : mat) (D : vec) (v : vec) : Prop :=
  exists a b, In a va /\ In b vb /\ len v <= W /\ len (minus v (cso R0 D a b)) <= ew.
Lemma sums_more : forall va vb W ew R0 D div vs ss n L acc, 1 <= n -> n + INR (length vs) <= 4 ->
  length ss = length vs -> Forall (Rle 0) (divided div ss) -> Forall (vertices_of va vb W ew R0 D) vs ->
  sums va vb W ew R0 D n L acc ->
  exists m, 1 <= m <= 4 /\ sums va vb W ew R0 D m (L + sum_of (divided div ss)) (fweighted ss vs div acc).
Proof.
  intros va vb W ew R0 D div. induction vs as [|v vs IH]; intros ss n L acc Hn Hm Hl Hs Hv H.
  - destruct ss; [|discriminate]. cbn. exists n. cbn in Hm. rewrite Rplus_0_r. split; [lra|assumption].
  - destruct ss as [|s ss]; [discriminate|]. cbn [length] in Hl, Hm. rewrite S_INR in Hm. pose proof (pos_INR (length vs)).
    cbn [divided map] in Hs. inversion Hs as [|? ? Hs1 Hs2]; subst.
    inversion Hv as [|? ? (a & b & Ha & Hb & HW & He) Hv2]; subst.
    cbn [fweighted divided map sum_of fold_right]. fold (divided div ss) (sum_of (divided div ss)).
    destruct (IH ss (n + 1) (L + fl (s / div)) (fadd_scaled acc v (fl (s / div)))) as (m & Hm' & K);
      [lra|lra|congruence|assumption|assumption| |].
    + apply (sums_step va vb W ew R0 D n L acc a b); try assumption. lra.
    + exists m. split; [assumption|]. replace (L + (fl (s / div) + sum_of (divided div ss)))
        with (L + fl (s / div) + sum_of (divided div ss)) by ring. assumption.
Qed.

Theorem point_sums : forall va vb W ew R0 D ws vs, (1 <= length ws <= 4)%nat -> length vs = length ws -> Forall float ws ->
  Forall (vertices_of va vb W ew R0 D) vs ->
  exists m L, 1 <= m <= 4 /\ Rabs (L - 1) <= 4.03 * u /\ sums va vb W ew R0 D m L (fpoint ws vs).
Proof.
  intros va vb W ew R0 D ws vs Hl Hv Hf H.
  destruct (shares_sum ws Hl Hf) as (Hd & Hs & He). set (div := or_one (fsum ws 0) (fsum ws 0)) in *.
  destruct (divided_sum div (fshares ws) Hd Hs) as [Hp Hq].
  pose proof (length_shares ws) as Hn. unfold fpoint. fold div.
  assert (HL : Rabs (sum_of (divided div (fshares ws)) - 1) <= 4.03 * u).
  { assert (INR (length (fshares ws)) <= 4).
    { rewrite Hn. replace 4 with (INR 4) by (cbn; lra). apply le_INR. lia. }
    assert (INR (length (fshares ws)) * eta <= 4 * eta) by (apply Rmult_le_compat_r; [apply Rlt_le, eta_pos|assumption]).
    apply Rabs_le_inv in He, Hq. apply Rabs_le. small. lra. }
  destruct (fshares ws) as [|s ss] eqn:Es; [cbn in Hn; lia|]. destruct vs as [|v vs]; [cbn in Hv; lia|].
  inversion H as [|? ? (a & b & Ha & Hb & HW & Hew) H2]; subst.
  cbn [divided map] in Hp. inversion Hp as [|? ? Hp1 Hp2]; subst. cbn [length] in *.
  destruct (sums_more va vb W ew R0 D div vs ss 1 (fl (s / div)) (fadd_scaled zero v (fl (s / div)))) as (m & Hm & K);
    [lra| |lia|assumption|assumption|apply (sums_first va vb W ew R0 D a b); assumption|].
  - replace 4 with (1 + INR 3) by (cbn; lra). apply Rplus_le_compat_l, le_INR. lia.
  - exists m, (fl (s / div) + sum_of (divided div ss)). split; [assumption|]. split; [exact HL|exact K].
Qed.
